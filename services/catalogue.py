"""The services there are. A new one is a folder and an entry here; commands follow from it."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # `zv --help` reads this module and needs none of that
    from common.settings import Settings


@dataclass(frozen=True, slots=True)
class Service:
    """One service; its loop is ``services.{name}.service.run``.

    Attributes:
        model: Module and class of its options.
        line: What it does, for ``zv --help``.
        example: A command to start it.
        command: What one types for it, where that is not its name.
        of_camera: Whether it belongs to one camera, whose name is then part of its own.
    """

    model: str
    line: str
    example: str
    command: str = ""
    of_camera: bool = True


SERVICES = {
    "router": Service(
        "services.router.settings:RouterSettings",
        "Run the Zenoh router that is built in.",
        "zv router --listen tcp/0.0.0.0:7447",
        of_camera=False,
    ),
    "camera": Service(
        "services.camera.settings:CameraSettings",
        "Publish a camera, a video, a folder or a synthetic scene.",
        "zv camera --camera front --source walk.avi --rate 10 --loop",
    ),
    "tracker": Service(
        "services.tracker.settings:TrackerSettings",
        "Publish the largest moving object of each frame.",
        "zv tracker --camera front --history 300",
    ),
    "edge": Service(
        "services.edge.settings:EdgeSettings",
        "Publish the edge map of each frame.",
        "zv edge --camera front --sigma 2 --high 150",
    ),
    "viewer": Service(
        "services.viewer.settings:ViewerSettings",
        "Show all cameras in the browser, and give their streams URLs.",
        "zv view --port 8081",
        command="view",
        of_camera=False,
    ),
}


def command_of(service: str) -> str:
    """Return what one types behind ``zv`` for a service."""
    return SERVICES[service].command or service


BY_COMMAND = {command_of(name): name for name in SERVICES}
"""The services by their commands."""


def model_of(service: str) -> type[Settings]:
    """Return the model of a service's options, without loading the service."""
    module, name = SERVICES[service].model.split(":")
    model: type[Settings] = getattr(importlib.import_module(module), name)
    return model
