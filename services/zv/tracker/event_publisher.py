"""Publishes the events of one camera's tracks."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from typing import Final

from zenoh_vision import Frame, Node
from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.messages import Header, LineCount, TrackEvent, ZoneCount
from zenoh_vision.topics import EVENTS
from zv.tracker.events.event import Event
from zv.tracker.events.track_events import EventRules, TrackEvents
from zv.tracker.settings import TrackerSettings
from zv.tracker.shapes import Line, Polygon, lines, polygons
from zv.tracker.tracking.track import Track

log = logging.getLogger(__name__)

SET_BACK_NS: Final = 1_000_000_000
"""If a stamp is earlier than the previous one by more than this, the clock was set back."""

CALIBRATION_WAIT_NS: Final = 2_000_000_000
"""Time within which a calibration that was published earlier is queried and received."""

Class = tuple[str | None, float | None]
"""Name of a class, and the score with which a model found it."""

Counted = tuple[dict[str, ZoneCount] | None, dict[str, LineCount] | None]


class EventPublisher:
    """Finds the events in the tracks of one camera and publishes them on its ``events`` key."""

    def __init__(self, node: Node, settings: TrackerSettings) -> None:
        self._node = node
        self._settings = settings
        self._events = TrackEvents(rules_of(settings))
        self._header: Header | None = None
        self._warned = False
        self._without_plane_ns: int | None = None
        self._classes: dict[int, Class] = {}  # of the tracks that have not ended, by their id

    def update(
        self,
        frame: Frame,
        tracks: Sequence[Track],
        settings: TrackerSettings,
        plane: PlaneView | None = None,
    ) -> Counted:
        """Publish what happened from the last frame to this one.

        Args:
            frame: The frame; a new epoch or a clock that was set back ends all earlier tracks.
            tracks: All tracks of the frame, in full-resolution pixels.
            settings: Zones, lines, dwell and anchor for this frame.
            plane: The mapping from pixels to the world; None without a calibration.

        Returns:
            The counts of zones and of lines for the ``Tracks`` message of the frame; None instead
            of the counts if there are no zones or no lines.
        """
        if settings is not self._settings:
            self._settings = settings
            self._events.adjust(rules_of(settings))
            self._warned = False
        if self._header is not None and tracks_end(self._header, frame.header):
            self._publish(self._header, self._events.end())
            self._without_plane_ns = None
        self._header = self._node.header(frame)
        self._warn_without_plane(plane, frame.header.stamp_ns)
        now: dict[int, Class] = {
            each.id: (each.class_name, each.score) for each in tracks if each.class_name
        }
        self._classes |= now
        self._publish(self._header, self._events.update(tracks, frame.header.stamp_ns, plane))
        self._classes = now
        return self._counts()

    def end(self) -> tuple[Header, Counted] | None:
        """Publish the ends of all tracks and stays: the camera has sent nothing for long.

        Returns:
            The header of the last frame, and the counts after it; None if there was no frame.
        """
        if self._header is None:
            return None
        self._publish(self._header, self._events.end())
        return self._header, self._counts()

    def _publish(self, header: Header, events: Iterable[Event]) -> None:
        for event in events:
            self._node.publish(EVENTS, message_of(event, header, self._classes.get(event.id)))

    def _counts(self) -> Counted:
        counts = self._events.counts
        return counts.zones or None, counts.lines or None

    def _warn_without_plane(self, plane: PlaneView | None, stamp_ns: int) -> None:
        """Log once that shapes in world units have no events without a calibration."""
        if plane is not None or self._without_plane_ns is None:
            self._without_plane_ns = None if plane is not None else stamp_ns
            return
        if stamp_ns - self._without_plane_ns < CALIBRATION_WAIT_NS:
            return
        rules = self._events.rules
        shapes: tuple[Polygon | Line, ...] = (*rules.zones, *rules.lines)
        in_world = [each.name for each in shapes if each.unit == "world"]
        if in_world and not self._warned:
            self._warned = True
            names = ", ".join(in_world)
            log.warning("no events of %s: in world units, but the camera has no plane", names)


def tracks_end(before: Header, now: Header) -> bool:
    """Return whether all tracks end between two successive frames.

    They end with their run, since ids start again; when the camera's clock is set back, since
    times before and after cannot be compared; and when the camera is rotated or mirrored, since
    places cannot. For a smaller step back, no time has passed.
    """
    turned = (now.rotated, now.mirrored) != (before.rotated, before.mirrored)
    return now.run != before.run or turned or now.stamp_ns < before.stamp_ns - SET_BACK_NS


def rules_of(settings: TrackerSettings) -> EventRules:
    """Return the zones, the lines and the other rules of events from the settings."""
    return EventRules(
        polygons(settings.zones), lines(settings.lines), settings.dwell, settings.anchor
    )


def message_of(event: Event, header: Header, class_: Class | None = None) -> TrackEvent:
    """Return the message of an event."""
    x, y = event.at.pixel
    name, score = class_ or (None, None)
    return TrackEvent(
        header=header,
        event=event.kind,
        id=event.id,
        zone=event.shape,
        direction=event.direction,
        x=x,
        y=y,
        stamp_ns=event.at.stamp_ns,
        count=event.count,
        inside=event.inside,
        dwell_s=event.dwell_s,
        world=event.at.world,
        class_name=name,
        score=score,
    )
