"""Turns the tracks of each frame into events."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.messages import LineCount, ZoneCount
from zv.tracker.events.event import Event, Moment
from zv.tracker.events.line_watch import LineWatch
from zv.tracker.events.sighting import Anchor, Sighting, sightings_of
from zv.tracker.events.zone_watch import ZoneWatch
from zv.tracker.shapes import Line, Polygon
from zv.tracker.tracking.track import Track


@dataclass(frozen=True, slots=True)
class EventRules:
    """Which events to find."""

    zones: tuple[Polygon, ...] = ()  # polygons with unique names
    lines: tuple[Line, ...] = ()  # lines with unique names
    dwell_s: float = 10.0  # time in a zone after which ``zone_dwell`` is reported, once per stay
    anchor: Anchor = "centre"  # the point of an object that zones and lines refer to


class Counts(NamedTuple):
    """The counts of all shapes, by name."""

    lines: dict[str, LineCount]
    zones: dict[str, ZoneCount]


@dataclass(slots=True)
class _Object:
    """A track that has not ended."""

    first: Moment  # when and where it was first seen
    last: Moment  # when and where it was last seen
    confirmed: bool = False  # whether it was ever confirmed; other tracks have no events
    lost: bool = False  # whether ``lost`` was reported, without ``confirmed`` since


class TrackEvents:
    """Finds the events of one camera's tracks, frame by frame.

    A track has events once it is confirmed. Events before that, such as crossing a line, are then
    reported with their own stamps. Only positions at which a track was seen count, not predicted
    ones: a track that reappears is assumed to have moved in a straight line. A stamp earlier than
    the previous one counts as the same.
    """

    def __init__(self, rules: EventRules) -> None:
        self.rules = rules
        self._lines = {line: LineWatch(line) for line in rules.lines}
        self._zones = {zone: ZoneWatch(zone) for zone in rules.zones}
        self._objects: dict[int, _Object] = {}
        self._waiting: list[Event] = []
        self._stamp_ns = 0
        self._plane: PlaneView | None = None

    @property
    def counts(self) -> Counts:
        """The counts after the last frame."""
        return Counts(
            {line.name: watch.count for line, watch in self._lines.items()},
            {zone.name: watch.count for zone, watch in self._zones.items()},
        )

    def adjust(self, rules: EventRules) -> None:
        """Apply other rules from the next frame on.

        Unchanged shapes keep their counts and state. A removed or changed zone ends the stays in
        it; a changed shape counts from 0 again.
        """
        for zone, watch in self._zones.items():
            if zone not in rules.zones:
                self._waiting += watch.close(self._stamp_ns)
        self._lines = {line: self._lines.get(line) or LineWatch(line) for line in rules.lines}
        self._zones = {zone: self._zones.get(zone) or ZoneWatch(zone) for zone in rules.zones}
        if rules.anchor != self.rules.anchor:
            for each in self._watches():
                each.restart()
        self.rules = rules

    def update(
        self, tracks: Sequence[Track], stamp_ns: int, plane: PlaneView | None = None
    ) -> list[Event]:
        """Process all tracks of the next frame and return their events, those of a track by time.

        Args:
            tracks: All tracks of the frame; tracks that are missing have ended.
            stamp_ns: Capture time of the frame.
            plane: The mapping from pixels to the world; None without a calibration. When it
                changes, paths in world units begin anew.
        """
        self._stamp_ns = stamp_ns = max(stamp_ns, self._stamp_ns)
        if plane != self._plane:
            self._plane = plane
            for each in self._watches():
                if each.shape.unit == "world":
                    each.restart()
        found, self._waiting = self._waiting, []
        present = {track.id for track in tracks}
        for id_ in [id_ for id_ in self._objects if id_ not in present]:
            found += _in_order(self._end(id_))
        seen = [track for track in tracks if track.state != "lost" and track.missing_s <= 0]
        sightings = sightings_of(seen, stamp_ns, self.rules.anchor, plane)
        by_id = {track.id: each for track, each in zip(seen, sightings, strict=True)}
        for track in tracks:
            found += _in_order(self._take(track, by_id.get(track.id)))
        return found

    def end(self) -> list[Event]:
        """End all tracks, as at the end of an epoch, and return their events. Counts stay."""
        found, self._waiting = self._waiting, []
        for id_ in list(self._objects):
            found += _in_order(self._end(id_))
        self._stamp_ns = 0  # another source may have another clock
        return found

    def _take(self, track: Track, sighting: Sighting | None) -> Iterator[Event]:
        known = self._objects.get(track.id)
        if sighting is None:
            if known is not None and track.state == "lost" and known.confirmed and not known.lost:
                known.lost = True
                yield Event("lost", track.id, known.last)
            return
        if known is None:
            known = self._objects[track.id] = _Object(sighting.at, sighting.at)
        known.last = sighting.at
        if track.state == "confirmed" and not known.confirmed:
            known.confirmed = True
            yield Event("started", track.id, known.first)
            yield Event("confirmed", track.id, sighting.at)
        elif track.state == "confirmed" and known.lost:
            known.lost = False
            yield Event("confirmed", track.id, sighting.at)
        confirmed, dwell_s = known.confirmed, self.rules.dwell_s
        for line in self._lines.values():
            yield from line.see(track.id, sighting, confirmed=confirmed)
        for zone in self._zones.values():
            yield from zone.see(track.id, sighting, confirmed=confirmed, dwell_s=dwell_s)

    def _end(self, id_: int) -> Iterator[Event]:
        known = self._objects.pop(id_)
        for line in self._lines.values():
            yield from line.end(id_, confirmed=known.confirmed)
        for zone in self._zones.values():
            yield from zone.end(id_)
        if known.confirmed:
            yield Event("ended", id_, known.last)

    def _watches(self) -> Iterator[LineWatch | ZoneWatch]:
        yield from self._lines.values()
        yield from self._zones.values()


def _in_order(events: Iterable[Event]) -> list[Event]:
    """Sort the events of one track by time. Across tracks, the order is that of the counts."""
    return sorted(events, key=lambda event: event.at.stamp_ns)
