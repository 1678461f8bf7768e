"""Events of tracks, with their times and positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from zv.tracker.shapes import Point

Kind = Literal[
    "started",
    "confirmed",
    "lost",
    "ended",
    "zone_entered",
    "zone_left",
    "zone_dwell",
    "line_crossed",
]
Direction = Literal["left", "right"]


@dataclass(frozen=True, slots=True)
class Moment:
    """The position of an object's anchor at a time."""

    stamp_ns: int  # the time, by the capture stamps
    pixel: Point  # position in full-resolution pixels
    world: Point | None = None  # position on the world plane; None without a calibration


@dataclass(frozen=True, slots=True)
class Event:
    """An event of one track."""

    kind: Kind  # what happened; see docs/events.md
    id: int  # the track's id
    at: Moment  # time and position; those of a crossing are interpolated between two frames
    shape: str | None = None  # name of the zone or line; None for other events
    # For ``line_crossed``, the side of the line to which the object moved, as the picture shows
    # it, looking from the line's first point to its second.
    direction: Direction | None = None
    # For zones and lines, the number of events of this kind and direction at the shape, including
    # this one.
    count: int | None = None
    inside: int | None = None  # for zones, the number of objects in the zone after this event
    # For ``zone_dwell`` and ``zone_left``, the time that the object was in the zone.
    dwell_s: float | None = None


def between(first: Moment, second: Moment, share: float) -> Moment:
    """Interpolate linearly between two moments; ``share`` is 0 at the first, 1 at the second."""
    world = None
    if first.world is not None and second.world is not None:
        world = _between(first.world, second.world, share)
    stamp_ns = first.stamp_ns + round(share * (second.stamp_ns - first.stamp_ns))
    return Moment(stamp_ns, _between(first.pixel, second.pixel, share), world)


def _between(first: Point, second: Point, share: float) -> Point:
    return (
        first[0] + share * (second[0] - first[0]),
        first[1] + share * (second[1] - first[1]),
    )
