"""Finds the crossings of one line, each exactly once.

The path of an object is the polyline through the positions at which it was seen. Each passage of
the path through the line counts +1 or -1, by its direction. The sum changes back and forth while
an object stands or jitters on the line. It is therefore compared with its earlier value only when
the object is farther from the line than a margin, or its track ends. If it differs, one crossing is
reported, with the time and position of the last passage in that direction. Crossings of an
unconfirmed track are reported when it is confirmed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from zenoh_vision.messages import LineCount
from zv.tracker.events.event import Direction, Event, Moment, between
from zv.tracker.events.sighting import Sighting
from zv.tracker.shapes import Line, Point, distance, passage, turn


@dataclass(slots=True)
class _Path:
    """The state of one object's path."""

    last: Sighting | None = None  # the last sighting; None before the first
    passages: int = 0  # sum of the passages: +1 to the right, -1 to the left
    settled: int = 0  # value of ``passages`` when the object was last clear of the line
    latest: dict[int, Moment] = field(default_factory=dict)  # the last passage in each direction
    # The crossings that are not reported yet.
    crossings: list[tuple[Direction, Moment]] = field(default_factory=list)

    def settle(self) -> None:
        """Add a crossing if the object is not on the side where it was last clear of the line."""
        if self.passages != self.settled:
            sign = 1 if self.passages > self.settled else -1
            self.settled = self.passages
            self.crossings.append(("right" if sign > 0 else "left", self.latest[sign]))


class LineWatch:
    """Finds and counts the crossings of one line by all objects."""

    def __init__(self, line: Line) -> None:
        self.shape = line
        self.count = LineCount()
        self._paths: dict[int, _Path] = {}

    def see(self, id_: int, sighting: Sighting, *, confirmed: bool) -> Iterator[Event]:
        """Process the next sighting of an object; yield its crossings.

        The crossings of an unconfirmed object are yielded when it is confirmed.
        """
        path = self._paths.setdefault(id_, _Path())
        point = sighting.position(self.shape.unit)
        if point is not None:  # else beyond the world plane's horizon
            self._follow(path, sighting, point)
        if confirmed:
            yield from self._report(id_, path)

    def end(self, id_: int, *, confirmed: bool) -> Iterator[Event]:
        """Forget an object whose track ended; yield a crossing that was not reported yet."""
        path = self._paths.pop(id_, None)
        if path is not None and confirmed:
            path.settle()
            yield from self._report(id_, path)

    def restart(self) -> None:
        """Begin all paths anew: earlier positions cannot be compared with later ones."""
        for path in self._paths.values():
            path.last = None
            path.passages = path.settled

    def _follow(self, path: _Path, sighting: Sighting, point: Point) -> None:
        if path.last is not None:
            self._pass(path, path.last, sighting, point)
        path.last = sighting
        if path.passages != path.settled and (
            distance(point, self.shape.start, self.shape.end) > sighting.margin(self.shape.unit)
        ):
            path.settle()

    def _pass(self, path: _Path, last: Sighting, sighting: Sighting, point: Point) -> None:
        """Count a passage if the step from the last sighting to this one crosses the line."""
        start, end = self.shape.start, self.shape.end
        before = last.position(self.shape.unit)
        assert before is not None
        share = passage(before, point, start, end)
        if share is not None:
            direction = sighting.side_sign(self.shape.unit) * (
                1 if turn(start, end, point) >= 0 else -1
            )
            path.passages += direction
            path.latest[direction] = between(last.at, sighting.at, share)

    def _report(self, id_: int, path: _Path) -> Iterator[Event]:
        for direction, at in path.crossings:
            count = getattr(self.count, direction) + 1
            self.count = self.count.model_copy(update={direction: count})
            name = self.shape.name
            yield Event("line_crossed", id_, at, shape=name, direction=direction, count=count)
        path.crossings.clear()
