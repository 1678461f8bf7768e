"""What happened to one track, where and when; and how often it has happened."""

from __future__ import annotations

from dataclasses import dataclass, field
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
    """Where the anchor of an object was at a time.

    Attributes:
        stamp_ns: The time, by the capture stamps.
        pixel: Position in full-resolution pixels.
        world: Position on the world plane; None without a calibration.
    """

    stamp_ns: int
    pixel: Point
    world: Point | None = None


@dataclass(frozen=True, slots=True)
class Event:
    """What happened to one track.

    Attributes:
        kind: ``started``: it was seen first; ``confirmed``: it is drawn now, for the first time
            or again; ``lost``: it was seen last; ``ended``: as lost, for good; the others concern
            a zone or a line.
        id: Of the track.
        at: When and where. Of a crossing, interpolated between two frames.
        shape: Name of the zone or line.
        direction: Of ``line_crossed``: the side of the line to which the object went, as the
            picture shows it, seen from the line's first point to its second.
        count: Of zones and lines: how many events of this kind and direction the shape has had,
            with this one.
        inside: Of zones: how many objects are in it after this event.
        dwell_s: Of ``zone_dwell`` and ``zone_left``: how long the object had been in the zone.
    """

    kind: Kind
    id: int
    at: Moment
    shape: str | None = None
    direction: Direction | None = None
    count: int | None = None
    inside: int | None = None
    dwell_s: float | None = None


@dataclass(slots=True)
class LineCount:
    """Crossings of a line since it has its position, by direction."""

    left: int = 0
    right: int = 0


@dataclass(slots=True)
class ZoneCount:
    """Stays in a zone since it has its shape, and the objects that are in it now."""

    entered: int = 0
    left: int = 0
    dwelled: int = 0
    inside: int = 0


@dataclass(slots=True)
class Counts:
    """The counts of all shapes, by name."""

    lines: dict[str, LineCount] = field(default_factory=dict)
    zones: dict[str, ZoneCount] = field(default_factory=dict)


def between(first: Moment, second: Moment, share: float) -> Moment:
    """Return the moment at a share, 0 to 1, of the way from one moment to another."""
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
