"""The services: how each is started, what it publishes and what it consumes, as data.

Commands, flags, the launch file and documentation derive from it. A new service needs a folder and
an entry here. This module imports nothing that loads slowly, so services can use it too.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # pydantic takes longer to load than `zv --help` takes
    from zenoh_vision.config.settings import Settings

EVERY_TOPIC = "**"


@dataclass(frozen=True, slots=True)
class Service:
    """One service; its loop is ``zv.{name}.service.run``.

    Attributes:
        model: Module and class of its settings.
        summary: What it does, for ``zv --help``.
        example: Command lines that start it, one a line.
        command: Its command, if that differs from its name.
        of_camera: Whether it belongs to one camera, whose name is then part of its node's name.
        of_several: Whether it can belong to several cameras: ``front,left``, or ``*`` for all.
        publishes: Topics that it may publish, by suffix (``image/compressed``), the main one first.
        consumes: Topics that it subscribes to, by suffix, or ``EVERY_TOPIC``.
        files: Module and class of further flags. With one of them, the service works on files,
            without a router, by ``zv.{name}.files.run``.
    """

    model: str
    summary: str
    example: str
    command: str = ""
    of_camera: bool = True
    of_several: bool = False
    publishes: tuple[str, ...] = ()
    consumes: tuple[str, ...] = ()
    files: str = ""


SERVICES = {
    "router": Service(
        "zv.router.settings:RouterSettings",
        "Run the built-in Zenoh router.",
        "zv router --listen tcp/0.0.0.0:7447",
        of_camera=False,
    ),
    "camera": Service(
        "zv.camera.settings:CameraSettings",
        "Publish a camera, a video, a folder or a synthetic scene.",
        "zv camera --camera front --source walk.avi --rate 10 --loop",
        # ``camera_info`` only with a calibration file, ``truth`` only of the synthetic scene.
        publishes=("image/compressed", "image", "camera_info", "truth"),
    ),
    "tracker": Service(
        "zv.tracker.settings:TrackerSettings",
        "Publish the moving objects of each frame, with ids.",
        "zv tracker --camera front --min-area 400",
        of_several=True,
        publishes=(
            "centroid",
            "tracks",
            "events",
            "prediction",
            "tracked/compressed",
            "mask/compressed",
            "background/compressed",
        ),
        consumes=("image/compressed", "image"),  # one of them, by the setting transport
    ),
    "edge": Service(
        "zv.edge.settings:EdgeSettings",
        "Publish the edges of each frame; or find those of a file.",
        "zv edge --camera front --sigma 2 --high 150\nzv edge --image in.png --out out.png",
        publishes=(
            "edges/compressed",
            "edges/smoothed/compressed",
            "edges/magnitude/compressed",
            "edges/direction/compressed",
            "edges/suppressed/compressed",
            "edges/thresholded/compressed",
            "edges/contours",
        ),
        consumes=("image/compressed", "image"),  # one of them, by the setting transport
        files="zv.edge.file_options:FileOptions",
    ),
    "viewer": Service(
        "zv.viewer.settings:ViewerSettings",
        "Show all cameras in the browser, and serve their streams under URLs.",
        "zv view --port 8081",
        command="view",
        of_camera=False,
        consumes=(EVERY_TOPIC,),
    ),
}


def command_of(service: str) -> str:
    """Return the command behind ``zv`` that starts a service."""
    return SERVICES[service].command or service


BY_COMMAND = {command_of(name): name for name in SERVICES}
"""The services by their commands."""


def published_by(service: str) -> tuple[str, ...]:
    """Return the suffixes of the topics that a service may publish, the main one first."""
    return SERVICES[service].publishes


def model_of(service: str) -> type[Settings]:
    """Return the model of a service's settings, without loading the service."""
    model: type[Settings] = imported(SERVICES[service].model)
    return model


def imported(place: str) -> Any:
    """Return the object at ``module:name``."""
    module, name = place.split(":")
    return getattr(importlib.import_module(module), name)
