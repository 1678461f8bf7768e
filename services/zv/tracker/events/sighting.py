"""Positions of the objects seen in one frame, in pixels and on the plane, with their margins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from zenoh_vision.calibration.plane_view import PlaneView, pair
from zv.tracker.events.event import Moment
from zv.tracker.shapes import Point, Unit
from zv.tracker.tracking.track import Track

Anchor = Literal["centre", "foot"]
"""The point of an object that zones and lines refer to: the centre of its box, or the middle of
the box's lower edge."""

HALF_PIXEL = 0.5
"""In boxes, 0 is the left or upper edge of the first pixel; in a calibration, 0 is its centre."""

MARGIN_PIXELS = 2.0
MARGIN_SHARE = 0.1
"""Margin as a share of the box's smaller side, since boxes of large objects jitter more."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """The position at which an object was seen, with the hysteresis for its jitter."""

    at: Moment  # time and position
    margin_pixels: float  # hysteresis at the edges of shapes in pixels, pixels
    # Hysteresis at the edges of shapes in world units, world units; infinite without a plane.
    margin_world: float = math.inf
    mirrored: bool = False  # the value of ``PlaneView.mirrored``; False without a plane

    def position(self, unit: Unit) -> Point | None:
        """Return the position in the unit of a shape; None if it is unknown."""
        return self.at.pixel if unit == "pixels" else self.at.world

    def margin(self, unit: Unit) -> float:
        """Return the margin in the unit of a shape."""
        return self.margin_pixels if unit == "pixels" else self.margin_world

    def side_sign(self, unit: Unit) -> int:
        """Return 1 if ``shapes.turn`` is positive on the right side in the picture, else -1."""
        return -1 if unit == "world" and self.mirrored else 1


def sightings_of(
    tracks: Sequence[Track], stamp_ns: int, anchor: Anchor, plane: PlaneView | None = None
) -> list[Sighting]:
    """Return the sightings of tracks at a stamp; with a plane, also their positions on it."""
    points = [anchor_of(track, anchor) for track in tracks]
    margins = [max(MARGIN_PIXELS, MARGIN_SHARE * min(track.box[2:])) for track in tracks]
    if plane is None or not tracks:
        return [
            Sighting(Moment(stamp_ns, point), margin)
            for point, margin in zip(points, margins, strict=True)
        ]
    # A plane seen at an angle has a different scale at every point and in every direction.
    pixels = np.array(points, np.float64)
    reach = np.array(margins)[:, None]
    around = np.concatenate([pixels, pixels + reach * (1, 0), pixels + reach * (0, 1)])
    places, beside, below = np.split(plane.positions(around - HALF_PIXEL), 3)
    # Beyond the horizon the margin is infinite, so the object is never clear of a shape.
    wide = np.maximum(np.hypot(*(beside - places).T), np.hypot(*(below - places).T))
    wide = np.where(np.isfinite(wide), wide, math.inf)
    return [
        Sighting(Moment(stamp_ns, point, pair(place)), margin, float(width), plane.mirrored)
        for point, margin, place, width in zip(points, margins, places, wide, strict=True)
    ]


def places(tracks: Sequence[Track], anchor: Anchor, plane: PlaneView | None) -> list[Point | None]:
    """Return the positions of tracks on a plane: X, Y of each anchor, None if it is not on it."""
    if plane is None or not tracks:
        return [None] * len(tracks)
    points = np.array([anchor_of(track, anchor) for track in tracks], np.float64)
    return [pair(place) for place in plane.positions(points - HALF_PIXEL)]


def anchor_of(track: Track, anchor: Anchor) -> Point:
    """Return the anchor of a track, x, y in full-resolution pixels."""
    return (track.x, track.y if anchor == "centre" else float(track.box[1] + track.box[3]))
