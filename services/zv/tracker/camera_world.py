"""The world as one camera sees it: places of tracks on its plane, and predictions."""

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
    """Follows a camera's calibration, and answers where its objects will be.

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
        """Take all tracks of the next frame.

        Args:
            frame: The frame.
            tracks: All of it, in full-resolution pixels.
            anchor: The point of an object that has a place in the world.

        Returns:
            The way from pixels to the plane, None without one; and the place of each track, None
            without a plane or beyond its horizon.
        """
        view = self._plane.view(frame.header)
        self._predictions.update(self._node.header(frame), tracks, anchor, view)
        return view, places(tracks, anchor, view)


def places(tracks: Sequence[Track], anchor: Anchor, view: PlaneView | None) -> list[Place | None]:
    """Return where tracks are on a plane: X, Y of the anchor of each, or None."""
    if view is None or not tracks:
        return [None] * len(tracks)
    points = np.array([anchor_of(track, anchor) for track in tracks], np.float64)
    return [pair(place) for place in view.positions(points - HALF_PIXEL)]
