"""The tracker's loop over the frames of one camera, several, or all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from zenoh_vision import Connection, Frame, Node
from zenoh_vision.config.settings import ALL_CAMERAS
from zenoh_vision.host.allocator import keep_freed_memory
from zv.registry import published_by
from zv.tracker.camera_tracking import CameraTracking, decoded
from zv.tracker.settings import TrackerSettings

MAX_CAMERAS = 64
"""Largest number of cameras tracked with ``*``; the frames of further ones count as processed and
as ``cameras_left_out``."""


def run(settings: TrackerSettings, connection: Connection) -> None:
    """Publish the moving objects of each frame until told to stop.

    Each camera has its own state. Only its newest frame waits, and the cameras are served in turn,
    so a fast, slow or silent camera does not delay the others.
    """
    keep_freed_memory()
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
            assert node.parameters is not None
            picture = decoded(frame, node.parameters.active.settings)
            return picture

        inputs = [
            node.frames(
                "image/compressed",
                camera=name,
                want=decode,
                max_pixels=settings.max_pixels,
                transport=None if name == ALL_CAMERAS else settings.transport,
            )
            for name in names or (ALL_CAMERAS,)
        ]
        tracked: dict[str, CameraTracking] = {}
        for frame in node.receive(*inputs):
            camera = frame.header.camera
            if camera not in tracked:
                if len(tracked) >= MAX_CAMERAS:
                    node.counters.note("cameras_left_out")
                    continue
                if camera not in node.cameras:
                    node.add_camera(camera, published_by("tracker"))
                tracked[camera] = CameraTracking(node, camera, settings)
            tracked[camera].process(frame, picture)
