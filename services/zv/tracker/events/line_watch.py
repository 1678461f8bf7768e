"""Finds the crossings of one line, each exactly once.

The path of an object is the polyline through the positions at which it was seen. Each passage of
the path through the line counts +1 or -1, by its direction. Their sum changes back and forth while
an object stands or jitters on the line, so it is reported only when the object is farther from the
line than a margin, or ends: then one crossing, if the sum is not what was reported before, with
the time and place of the last passage in that direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from zv.tracker.events.event import Direction, Event, LineCount, Moment, between
from zv.tracker.events.sighting import Sighting
from zv.tracker.shapes import Line, Point, distance, passage, turn


@dataclass(slots=True)
class _Path:
    """What is kept of the path of one object.

    Attributes:
        last: The last sighting.
        passages: Sum of the passages: +1 to the right, -1 to the left.
        reported: What ``passages`` was when it was reported last.
        latest: The last passage in each direction.
    """

    last: Sighting
    passages: int = 0
    reported: int = 0
    latest: dict[int, Moment] = field(default_factory=dict)


class LineWatch:
    """The crossings of one line by all objects."""

    def __init__(self, line: Line) -> None:
        self.line = line
        self.count = LineCount()
        self._paths: dict[int, _Path] = {}

    def see(self, id_: int, sighting: Sighting, *, confirmed: bool) -> Iterator[Event]:
        """Take the next sighting of an object; yield a crossing if there is one to report.

        Of an object that is not confirmed, nothing is reported; its path is kept.
        """
        point = sighting.position(self.line.unit)
        if point is None:  # beyond the world plane's horizon
            return
        path = self._paths.get(id_)
        if path is None:
            self._paths[id_] = _Path(sighting)
            return
        self._pass(path, sighting, point)
        path.last = sighting
        if path.passages == path.reported or not confirmed:
            return
        if distance(point, self.line.start, self.line.end) > sighting.margin(self.line.unit):
            yield self._report(id_, path)

    def end(self, id_: int, *, confirmed: bool) -> Iterator[Event]:
        """Forget an object that ended; yield the crossing that was not reported yet."""
        path = self._paths.pop(id_, None)
        if path is not None and confirmed and path.passages != path.reported:
            yield self._report(id_, path)

    def restart(self) -> None:
        """Forget the paths: positions before and after have different meanings."""
        self._paths.clear()

    def _pass(self, path: _Path, sighting: Sighting, point: Point) -> None:
        """Count a passage of the step from the last sighting to this one, if it is one."""
        start, end = self.line.start, self.line.end
        before = path.last.position(self.line.unit)
        assert before is not None
        share = passage(before, point, start, end)
        if share is not None:
            direction = 1 if turn(start, end, point) >= 0 else -1
            path.passages += direction
            path.latest[direction] = between(path.last.at, sighting.at, share)

    def _report(self, id_: int, path: _Path) -> Event:
        sign = 1 if path.passages > path.reported else -1
        path.reported = path.passages
        # In a picture y points down, on a plane seen from above it points up.
        to_right = (sign > 0) == (self.line.unit == "pixels")
        direction: Direction = "right" if to_right else "left"
        count = getattr(self.count, direction) + 1
        setattr(self.count, direction, count)
        return Event(
            "line_crossed",
            id_,
            path.latest[sign],
            shape=self.line.name,
            direction=direction,
            count=count,
        )
