"""The positions of objects in one frame in which they were seen, as shapes need them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from zv.tracker.events.event import Moment
from zv.tracker.shapes import Point, Unit
from zv.tracker.tracking.track import Track

Anchor = Literal["centre", "foot"]
"""The point of a box that counts: its centre, or the middle of its lower edge."""

HALF_PIXEL = 0.5
"""A box begins at the edge of its first pixel; a calibration counts from the middle of one."""

MARGIN_PIXELS = 2.0
MARGIN_SHARE = 0.1
"""Of the smaller side of the box: boxes of large objects jitter more."""


class WorldPlane(Protocol):
    """The way from pixels to a plane, such as a ``PlaneView``; equal ones are the same plane."""

    @property
    def mirrored(self) -> bool:
        """Whether right of a way in the picture is left of it by X, Y of the plane."""
        ...

    def positions(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return X, Y of full-resolution pixels, both (n, 2); NaN where there is no plane."""
        ...


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where an object was seen, and by how much it may seem to move while it stands.

    Attributes:
        at: Time and place.
        margin_pixels: The hysteresis at the edges of shapes in pixels.
        margin_world: The same for shapes in world units; infinite without a plane.
        mirrored: As of its ``WorldPlane``; False without one.
    """

    at: Moment
    margin_pixels: float
    margin_world: float = math.inf
    mirrored: bool = False

    def position(self, unit: Unit) -> Point | None:
        """Return its position in the unit of a shape; None if there is none."""
        return self.at.pixel if unit == "pixels" else self.at.world

    def margin(self, unit: Unit) -> float:
        """Return its margin in the unit of a shape."""
        return self.margin_pixels if unit == "pixels" else self.margin_world

    def side_sign(self, unit: Unit) -> int:
        """Return 1 if ``turn`` is positive on the right side in the picture, else -1."""
        return -1 if unit == "world" and self.mirrored else 1


def sightings_of(
    tracks: Sequence[Track], stamp_ns: int, anchor: Anchor, plane: WorldPlane | None = None
) -> list[Sighting]:
    """Return the sightings of tracks at a stamp; with a plane, their places on it too."""
    points = [anchor_of(track, anchor) for track in tracks]
    margins = [max(MARGIN_PIXELS, MARGIN_SHARE * min(track.box[2:])) for track in tracks]
    if plane is None or not tracks:
        return [
            Sighting(Moment(stamp_ns, point), margin)
            for point, margin in zip(points, margins, strict=True)
        ]
    # A plane that is seen at an angle has another scale at every point, and in each direction.
    pixels = np.array(points, np.float64)
    reach = np.array(margins)[:, None]
    around = np.concatenate([pixels, pixels + reach * (1, 0), pixels + reach * (0, 1)])
    places, beside, below = np.split(plane.positions(around - HALF_PIXEL), 3)
    # Of infinite margins nothing is ever clear: a neighbour is beyond the horizon.
    wide = np.maximum(np.hypot(*(beside - places).T), np.hypot(*(below - places).T))
    wide = np.where(np.isfinite(wide), wide, math.inf)
    return [
        Sighting(Moment(stamp_ns, point, _pair(place)), margin, float(width), plane.mirrored)
        for point, margin, place, width in zip(points, margins, places, wide, strict=True)
    ]


def anchor_of(track: Track, anchor: Anchor) -> Point:
    """Return the point of a track that counts, full-resolution pixels."""
    return (track.x, track.y if anchor == "centre" else float(track.box[1] + track.box[3]))


def _pair(place: NDArray[np.float64]) -> Point | None:
    x, y = map(float, place)
    return (x, y) if math.isfinite(x) and math.isfinite(y) else None
