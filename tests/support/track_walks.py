"""Tracks that walk, and what is read from their events."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from zv.tracker.events.event import Event
from zv.tracker.events.track_events import EventRules, TrackEvents
from zv.tracker.shapes import lines, polygons
from zv.tracker.tracking.track import Track

STEP_NS = 100_000_000
BOX = 20  # pixels; the margin is then max(2, 10 % of it) = 2 pixels


def rules(zones: str = "", lines_: str = "", **changes) -> EventRules:
    return EventRules(polygons(zones), lines(lines_), **changes)


def track(x: float, y: float, *, id_: int = 1, state="confirmed", missing_s=0.0) -> Track:
    """Return a track with a box of 20 x 20 around its centre."""
    box = (round(x) - BOX // 2, round(y) - BOX // 2, BOX, BOX)
    return Track(id_, state, x, y, box, 400.0, missing_s=missing_s)


def walk(
    events: TrackEvents, points: Iterable[tuple[float, float]], *, start: int = 0, end: bool = False
) -> list[Event]:
    """Return the events of one confirmed track at these points, one every 100 ms from 0 on."""
    found = []
    number = start
    for number, (x, y) in enumerate(points, start):
        found += events.update([track(x, y)], number * STEP_NS)
    if end:
        found += events.update([], (number + 1) * STEP_NS)
    return found


def kinds(found: Sequence[Event], *wanted: str) -> list[str]:
    """Return the kinds of events in their order; only those wanted, if any are named."""
    return [event.kind for event in found if not wanted or event.kind in wanted]


def crossings(found: Sequence[Event]) -> list[str | None]:
    """Return the directions of the crossings in their order."""
    return [event.direction for event in found if event.kind == "line_crossed"]
