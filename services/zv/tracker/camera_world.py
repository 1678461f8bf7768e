"""World positions of one camera's tracks on its calibrated plane, and their predictions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from zenoh_vision import Frame, Node
from zenoh_vision.calibration.plane_view import PlaneView, pair
from zv.tracker.camera_plane import CameraPlane
from zv.tracker.events.sighting import HALF_PIXEL, Anchor, anchor_of
from zv.tracker.prediction.answers import PredictionAnswers
from zv.tracker.tracking.track import Track

Place = tuple[float, float]


class CameraWorld:
    """Maps a camera's tracks to the world plane, and answers queries for predictions.

    Args:
        node: The tracker, open.
        camera: The camera's name.
    """

    def __init__(self, node: Node, camera: str) -> None:
        self._node = node
        self._plane = CameraPlane(node, camera)
        self._predictions = PredictionAnswers(node, camera)

    def update(
        self, frame: Frame, tracks: Sequence[Track], anchor: Anchor
    ) -> tuple[PlaneView | None, list[Place | None]]:
        """Map all tracks of the next frame to the plane, and keep them for predictions.

        Args:
            frame: The frame.
            tracks: All tracks of the frame, in full-resolution pixels.
            anchor: The point of an object whose world position is wanted.

        Returns:
            The mapping from pixels to the plane, None without one; and the position of each
            track on it, None without a plane or beyond its horizon.
        """
        view = self._plane.view(frame.header)
        self._predictions.update(self._node.header(frame), tracks, anchor, view)
        return view, places(tracks, anchor, view)


def places(tracks: Sequence[Track], anchor: Anchor, view: PlaneView | None) -> list[Place | None]:
    """Return the positions of tracks on a plane: X, Y of each anchor, None if it is not on it."""
    if view is None or not tracks:
        return [None] * len(tracks)
    points = np.array([anchor_of(track, anchor) for track in tracks], np.float64)
    return [pair(place) for place in view.positions(points - HALF_PIXEL)]
