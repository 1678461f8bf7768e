"""Finds the stays of objects in one zone: when they enter, leave, and have stayed for a while.

An object enters when it is inside, and leaves when it is farther outside than a margin, so that one
that jitters on the edge enters once. Each stay ends with exactly one ``zone_left``. Stays of an
unconfirmed track are reported when it is confirmed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from zenoh_vision.messages import ZoneCount
from zv.tracker.events.event import Event, Kind, Moment, between
from zv.tracker.events.sighting import Sighting
from zv.tracker.shapes import Point, Polygon, contains, distance, passage


@dataclass(slots=True)
class _Stay:
    """The stay of one object."""

    entered: Moment  # when and where the object entered
    last: Sighting  # the last sighting, inside or within the margin
    # When and where the object passed the edge, while it is outside within the margin, or when and
    # where the stay ended; None while it is inside.
    out: Moment | None = None
    reported: bool = False  # whether ``zone_entered`` was reported
    dwelled: bool = False  # whether ``zone_dwell`` was reported


class ZoneWatch:
    """Finds and counts the stays of all objects in one zone."""

    def __init__(self, zone: Polygon) -> None:
        self.shape = zone
        self.count = ZoneCount()
        self._before: dict[int, Sighting] = {}
        self._stays: dict[int, _Stay] = {}
        self._ended: dict[int, list[_Stay]] = {}  # of unconfirmed objects, not reported yet

    def see(
        self, id_: int, sighting: Sighting, *, confirmed: bool, dwell_s: float
    ) -> Iterator[Event]:
        """Process the next sighting of an object; yield its events.

        The events of an unconfirmed object are yielded when it is confirmed.
        """
        point = sighting.position(self.shape.unit)
        if point is not None:  # else beyond the world plane's horizon
            self._follow(id_, sighting, point)
        stay = self._stays.get(id_)
        if confirmed:
            for former in self._ended.pop(id_, ()):
                yield from self._report(id_, former, dwell_s)
                yield self._left(id_, former)
            if stay is not None:
                yield from self._report(id_, stay, dwell_s)
        if point is None or stay is None or stay.out is None:
            return
        if self._outside_by(point) > sighting.margin(self.shape.unit):
            yield from self._leave(id_, stay.out)

    def end(self, id_: int) -> Iterator[Event]:
        """Forget an object whose track ended; its stay ends where it was last seen."""
        self._before.pop(id_, None)
        stay = self._stays.get(id_)
        if stay is not None:
            yield from self._leave(id_, stay.out or stay.last.at)
        self._ended.pop(id_, None)  # it was never confirmed

    def close(self, stamp_ns: int) -> Iterator[Event]:
        """End all stays at a stamp: the zone is removed or changed."""
        for id_, stay in list(self._stays.items()):
            last = stay.last.at
            stamp_ns = max(stamp_ns, last.stamp_ns)
            yield from self._leave(id_, stay.out or Moment(stamp_ns, last.pixel, last.world))

    def restart(self) -> None:
        """Begin all paths anew, but keep the stays: earlier positions cannot be compared."""
        self._before.clear()

    def _follow(self, id_: int, sighting: Sighting, point: Point) -> None:
        """Begin or continue the stay of an object that is inside or within the margin."""
        before = self._before.get(id_)
        self._before[id_] = sighting
        stay = self._stays.get(id_)
        inside = contains(self.shape.points, point)
        if stay is None:
            if not inside:
                return
            stay = self._stays[id_] = _Stay(self._edge(before, sighting), sighting)
        elif inside:
            stay.out = None
        elif stay.out is None:
            stay.out = self._edge(before, sighting)
        stay.last = sighting

    def _edge(self, before: Sighting | None, now: Sighting) -> Moment:
        """Return when and where the step between two sightings passed the edge."""
        start = None if before is None else before.position(self.shape.unit)
        end = now.position(self.shape.unit)
        assert end is not None
        if before is None or start is None:
            return now.at
        shares = [passage(start, end, *edge) for edge in self.shape.edges]
        found = [share for share in shares if share is not None]
        return between(before.at, now.at, max(found)) if found else now.at

    def _outside_by(self, point: Point) -> float:
        return min(distance(point, *edge) for edge in self.shape.edges)

    def _report(self, id_: int, stay: _Stay, dwell_s: float) -> Iterator[Event]:
        """Yield the events of a stay other than its end, each once."""
        if not stay.reported:
            stay.reported = True
            self._add(entered=1, inside=1)
            yield self._event("zone_entered", id_, stay.entered, self.count.entered)
        until = stay.last.at if stay.out is None else stay.out
        dwell_ns = round(dwell_s * 1e9)
        if not stay.dwelled and until.stamp_ns - stay.entered.stamp_ns >= dwell_ns:
            stay.dwelled = True
            self._add(dwelled=1)
            at = Moment(stay.entered.stamp_ns + dwell_ns, until.pixel, until.world)
            yield self._event("zone_dwell", id_, at, self.count.dwelled, dwell_s)

    def _leave(self, id_: int, at: Moment) -> Iterator[Event]:
        stay = self._stays.pop(id_)
        stay.out = at
        if stay.reported:
            yield self._left(id_, stay)
        else:
            self._ended.setdefault(id_, []).append(stay)

    def _left(self, id_: int, stay: _Stay) -> Event:
        assert stay.out is not None
        self._add(left=1, inside=-1)
        stayed_s = (stay.out.stamp_ns - stay.entered.stamp_ns) / 1e9
        return self._event("zone_left", id_, stay.out, self.count.left, stayed_s)

    def _add(self, **steps: int) -> None:
        new = {name: getattr(self.count, name) + step for name, step in steps.items()}
        self.count = self.count.model_copy(update=new)

    def _event(
        self, kind: Kind, id_: int, at: Moment, count: int, dwell_s: float | None = None
    ) -> Event:
        name, inside = self.shape.name, self.count.inside
        return Event(kind, id_, at, shape=name, count=count, inside=inside, dwell_s=dwell_s)
