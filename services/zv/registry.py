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
        sets: Whether it sets parameters of other nodes.
        records: Whether it writes recordings, and answers who has it write one.
        alone: Module and class of further flags, and module and name of the function that is
            called with the settings and these if one of them is given: it does something else than
            the service, without a router.
    """

    model: str
    summary: str
    example: str
    command: str = ""
    of_camera: bool = True
    of_several: bool = False
    publishes: tuple[str, ...] = ()
    consumes: tuple[str, ...] = ()
    sets: bool = False
    records: bool = False
    alone: tuple[str, str] | None = None


TRACKER_PICTURES = ("tracked/compressed", "mask/compressed", "background/compressed")
EDGE_PICTURES = (
    "edges/compressed",
    "edges/smoothed/compressed",
    "edges/magnitude/compressed",
    "edges/direction/compressed",
    "edges/suppressed/compressed",
    "edges/thresholded/compressed",
)

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
        "zv camera --camera front --source walk.avi --rate 10 --loop\nzv camera --list",
        # ``camera_info`` only with a calibration file, ``truth`` only of the synthetic scene.
        publishes=("image/compressed", "image", "camera_info", "truth"),
        alone=("zv.camera.list_options:ListOptions", "zv.camera.list_devices:run"),
    ),
    "tracker": Service(
        "zv.tracker.settings:TrackerSettings",
        "Publish the moving objects of each frame, with ids.",
        "zv tracker --camera front --min-area 400",
        of_several=True,
        publishes=("centroid", "tracks", "events", "prediction", *TRACKER_PICTURES),
        # One of the two images, by the setting transport.
        consumes=("image/compressed", "image", "camera_info"),
    ),
    "edge": Service(
        "zv.edge.settings:EdgeSettings",
        "Publish the edges of each frame; or find those of a file.",
        "zv edge --camera front --sigma 2 --high 150\nzv edge --image in.png --out out.png",
        publishes=(*EDGE_PICTURES, "edges/contours"),
        consumes=("image/compressed", "image"),  # one of them, by the setting transport
        alone=("zv.edge.file_options:FileOptions", "zv.edge.files:run"),
    ),
    "notify": Service(
        "zv.notify.settings:NotifySettings",
        "Send events with their picture to a webhook and to an MQTT broker.",
        "zv notify --webhook http://127.0.0.1:9000/event\n"
        "zv notify --mqtt mqtt://127.0.0.1 --events zone_entered,line_crossed",
        of_several=True,
        consumes=("events", "tracked/compressed", "image/compressed"),
    ),
    "relay": Service(
        "zv.relay.settings:RelaySettings",
        "Publish a stream of pictures again: slower, smaller, cropped or rectified.",
        "zv relay vision/front/image/compressed --rate 2 --scale 0.5 --quality 60\n"
        "zv relay --camera front --rectify --to front_flat",
        # The first by default, the others as the camera ``to``.
        publishes=("relayed/compressed", "image/compressed", "camera_info"),
        # One of the pictures, by the setting key.
        consumes=(
            *("image/compressed", "image", "camera_info"),
            *TRACKER_PICTURES,
            *EDGE_PICTURES,
        ),
    ),
    "viewer": Service(
        "zv.viewer.settings:ViewerSettings",
        "Show all cameras in the browser, and serve their streams under URLs.",
        "zv view --port 8081\nzv view run.mcap",
        command="view",
        of_camera=False,
        consumes=(EVERY_TOPIC,),
        sets=True,
    ),
    "recorder": Service(
        "zv.recorder.settings:RecorderSettings",
        "Record what is on the network, all the time or around events.",
        "zv recorder --output recordings/run.mcap --total-mb 10000\n"
        "zv recorder --last 30s --on-event line_crossed",
        of_camera=False,
        consumes=(EVERY_TOPIC,),
        records=True,
    ),
}


@dataclass(frozen=True, slots=True)
class FileCommand:
    """A command that does on files what a service does on frames, without a router.

    Attributes:
        service: The service, whose settings are flags too; it is run by ``zv.{service}.files.run``.
        options: Module and class of the further flags.
        summary: What it does, for ``zv --help``.
        example: Command lines, one a line.
        details: The help text below the summary.
    """

    service: str
    options: str
    summary: str
    example: str
    details: str = ""


FILE_COMMANDS = {
    "track": FileCommand(
        "tracker",
        "zv.tracker.file_options:FileOptions",
        "Write the tracks of a video, a recording or a folder; or find the objects of an image.",
        "zv track walk.avi -o tracks.csv\n"
        "zv track run.mcap -o tracks.txt --learning-time 5s\n"
        "zv track --image street.jpg --model yolo11n.onnx\n"
        "zv track --image street.jpg --model yolo11n.onnx --classes person,car -o boxes.png",
        "Of a FILE, every frame is processed, the next when the last is done, so the result is the "
        "same each time; a row of the CSV is an object of a frame. With --image, a line is printed "
        "for each object: class, score, box as x,y WIDTHxHEIGHT in pixels. The flags "
        "of the tracker apply. Needs no router.",
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
