"""The tracker's loop over the frames of one camera, several, or all."""

from __future__ import annotations

import logging
import time
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zenoh_vision import Connection, Frame, Node
from zenoh_vision.config.settings import ALL_CAMERAS
from zenoh_vision.host.allocator import keep_freed_memory
from zv.registry import published_by
from zv.tracker.camera_tracking import CameraTracking, decoded
from zv.tracker.detector.class_names import Wanted, check_known
from zv.tracker.detector.model import Model
from zv.tracker.detector.options import classes_of
from zv.tracker.detector_loop import DetectorLoop, options_of
from zv.tracker.settings import TrackerSettings

log = logging.getLogger(__name__)

MAX_CAMERAS = 64
"""Largest number of cameras tracked with ``*``; the frames of further ones count as processed and
as ``cameras_left_out``."""

EXPIRE_EVERY_S: Final = 1.0
"""Interval in which the tracks of cameras that are silent are looked for."""


def run(settings: TrackerSettings, connection: Connection) -> None:
    """Publish the moving objects of each frame until told to stop.

    Each camera has its own state. Only its newest frame waits, and the cameras are served in turn,
    so a fast, slow or silent camera does not delay the others.

    Raises:
        UnusableModel: The model cannot be run.
        ConfigurationError: A setting does not fit the model.
    """
    keep_freed_memory()
    model = None if settings.model is None else loaded_model(settings)
    names = settings.cameras
    with Node(
        "tracker",
        camera=names[0] if len(names) == 1 else names,
        connection=connection,
        publishes=published_by("tracker"),
        parameters=settings,
    ) as node:
        picture = np.empty((0, 0, 3), np.uint8)

        def decode(frame: Frame) -> NDArray[np.uint8]:
            nonlocal picture
            picture = decoded(frame, frame.revision.settings)
            return picture

        inputs = [
            node.frames(
                "image/compressed",
                camera=name,
                want=decode if model is None else _nothing,
                max_pixels=settings.max_pixels,
                transport=None if name == ALL_CAMERAS else settings.transport,
            )
            for name in names or (ALL_CAMERAS,)
        ]
        cameras = TrackedCameras(node, settings)
        if model is not None:
            DetectorLoop(node, model, cameras.tracking_of).run(inputs)
            return
        for frame in node.receive(*inputs, every_s=EXPIRE_EVERY_S):
            if frame is None:
                cameras.expire()
                continue
            tracking = cameras.tracking_of(frame.header.camera)
            if tracking is not None:
                tracking.process(frame, picture)


class TrackedCameras:
    """The state of each camera that has sent a frame."""

    def __init__(self, node: Node, settings: TrackerSettings) -> None:
        self._node = node
        self._settings = settings
        self._tracked: dict[str, CameraTracking] = {}

    def tracking_of(self, camera: str) -> CameraTracking | None:
        """Return the state of a camera; None if there are ``MAX_CAMERAS`` already."""
        if camera not in self._tracked:
            if len(self._tracked) >= MAX_CAMERAS:
                self._node.counters.note("cameras_left_out")
                return None
            if camera not in self._node.cameras:
                self._node.add_camera(camera, published_by("tracker"))
            self._tracked[camera] = CameraTracking(self._node, camera, self._settings)
        return self._tracked[camera]

    def expire(self) -> None:
        """End the tracks of cameras that have fallen silent."""
        for each in self._tracked.values():
            each.expire(time.monotonic())


def _nothing(_: Frame) -> None:
    """Decode nothing: it depends on the model whether pixels are needed, and in which size."""


def loaded_model(settings: TrackerSettings) -> Model:
    """Load the model of the settings.

    Raises:
        UnusableModel: It cannot be run.
        ConfigurationError: A setting does not fit it.
    """
    model = Model(options_of(settings))
    if settings.pipeline != "detector":
        log.warning(
            "the model is loaded but not used: pipeline = %s; allowed too: detector",
            settings.pipeline,
        )
    check_known(Wanted(settings.least_score, classes_of(settings.classes)), model.names)
    return model
