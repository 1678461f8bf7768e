"""Takes the events of all trackers and keeps each with a picture, on a thread of its own."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.keys import JPEG
from zenoh_vision.messages import Header, Level, TrackEvent, Tracks
from zenoh_vision.node.inputs import Input
from zenoh_vision.node.node import Node
from zenoh_vision.stream.buffer import queue
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.topics import COMPRESSED, EVENTS, TRACKS, Topic
from zenoh_vision.transport.query import newest
from zenoh_vision.transport.subscriber import sample_of
from zv.viewer.kept.store import EventStore, Picture, Seen
from zv.viewer.settings import ViewerSettings
from zv.viewer.streams.rendering import RenderOptions, original, render

log = logging.getLogger("viewer")

WAITING: Final = 1000
"""Limit of events that wait to be kept; beyond it the oldest is dropped as ``overwritten``."""

AT_ONCE: Final = 50
TAKE_S: Final = 0.2
IDLE_S: Final = 60.0
"""Without an event for this long, those that are too old are removed."""

NEXT_PICTURE_S: Final = 0.3
NO_PICTURE_S: Final = 5.0
"""A camera is asked for a picture at most this often; the second if it gave none."""

SIZE: Final = RenderOptions(320, 320, fit=True, format="jpeg")
QUALITY: Final = 75
MOST_BYTES: Final = 32 << 20
MOST_CAMERAS: Final = 64
STOP_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class View:
    """A picture of a camera, and the tracks of its frame; asked for again from a time."""

    again_s: float
    header: Header | None = None
    picture: Picture | None = None
    tracks: Tracks | None = None


def file_in(folder: str, namespace: str, viewer: str) -> Path:
    """Return the file of the events that a viewer keeps in a folder."""
    return Path(folder) / f"{namespace}_{viewer}.sqlite"


class EventKeeper:
    """Keeps events within the ``with`` block, which lies within that of the node.

    Cameras are asked for pictures only when events come. If events cannot be kept, the node's
    health says why, and they are dropped as ``not_kept``.
    """

    def __init__(
        self, node: Node, store: EventStore, settings: Callable[[], ViewerSettings]
    ) -> None:
        self._node = node
        self._store = store
        self._settings = settings
        self._views: dict[str, View] = {}
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        events = self._node.messages(EVENTS, camera="*", buffering=queue(WAITING))
        self._thread = threading.Thread(target=self._run, args=[events], name="events", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(STOP_S)

    def _is_ended(self) -> bool:
        return self._ended.is_set() or self._node.stopping

    def _run(self, events: Input[object]) -> None:
        written_s = float("-inf")
        while not self._is_ended():
            found = _taken(events)
            if not found and time.monotonic() < written_s + IDLE_S:
                continue
            written_s = time.monotonic()
            try:
                self._keep(found)
            except Exception as error:
                log.exception("events could not be kept")
                self._node.counters.drop("not_kept", len(found))
                self._warn(f"unexpected {type(error).__name__}: this is a bug in zv")
        self._store.close()

    def _keep(self, events: Sequence[TrackEvent]) -> None:
        settings = self._settings()
        keep = settings.keep_events > 0
        seen = [self._seen(event) for event in events if keep]
        is_unused = not keep and not self._store.path.exists()
        if is_unused or self._store.add(seen, settings.keep_events, int(settings.events_mb * 1e6)):
            for _ in events:
                self._node.counters.finish()
        else:
            self._node.counters.drop("not_kept", len(events))
        self._warn(self._store.fault)

    def _warn(self, fault: str) -> None:
        health = self._node.health
        if fault != health.message("events"):
            health.report("events", Level.WARN if fault else Level.OK, fault)
            log.warning("%s", fault or "events are kept again")

    def _seen(self, event: TrackEvent) -> Seen:
        """Return an event with the picture of its frame, or of one that is near it."""
        header = event.header
        view = self._views.get(header.camera)
        is_same = view is not None and view.header is not None and _same(view.header, header)
        if view is None or not (is_same or time.monotonic() < view.again_s):
            self._views.pop(header.camera, None)
            if len(self._views) >= MOST_CAMERAS:
                del self._views[next(iter(self._views))]
            view = self._views[header.camera] = self._look(header)
        shown, tracks = view.header, view.tracks
        later = box = None
        if shown is not None and shown.epoch == header.epoch:
            later = shown.seq - header.seq
        if tracks is not None and tracks.header.epoch == header.epoch:
            box = next((each.box for each in tracks.tracks if each.id == event.id), None)
        return Seen(event, view.picture, later, box)

    def _look(self, event: Header) -> View:
        """Ask a camera for the picture of an event's frame, then its tracker for its tracks.

        A camera that has no such picture any more gives its newest one. The tracker publishes an
        event before the tracks of its frame, so that its newest ones may be older.
        """
        shown: Header | None = None
        picture: Picture | None = None
        tracks: Tracks | None = None
        for sample in self._asked(COMPRESSED, event):
            with self._dropping():
                if picture is None:
                    shown, picture = self._picture(sample)
        frame = shown or event
        for sample in self._asked(TRACKS, frame):
            with self._dropping():
                found = Tracks.from_bytes(sample.payload.to_bytes())
                tracks = found if _same(found.header, frame) else tracks
        wait_s = NO_PICTURE_S if picture is None else NEXT_PICTURE_S
        return View(time.monotonic() + wait_s, shown, picture, tracks)

    def _asked(self, topic: Topic, frame: Header) -> list[zenoh.Sample]:
        key = topic.key(self._node.connection.namespace, frame.camera)
        try:
            return newest(self._node.link.session, [key], MOST_BYTES, self._is_ended, frame)
        except zenoh.ZError as error:  # the session is being replaced
            log.debug("no %s: %s", key, error)
            return []

    @contextmanager
    def _dropping(self) -> Iterator[None]:
        try:
            yield
        except PayloadError as error:
            self._node.health.log_drop(error)

    def _picture(self, sample: zenoh.Sample) -> tuple[Header, Picture]:
        settings = self._settings()
        frame = snapshot_of(sample_of(sample), JPEG, settings.max_pixels)
        finder = RangeFinder((settings.depth_min, settings.depth_max))
        found = original(frame, SIZE) or render(frame, SIZE, QUALITY, finder)
        return found.header, Picture(found.payload)


def _same(one: Header, other: Header) -> bool:
    """Tell whether two headers are of one frame."""
    return (one.epoch, one.seq) == (other.epoch, other.seq)


def _taken(events: Input[object]) -> list[TrackEvent]:
    """Return the events that wait, at most ``AT_ONCE``; wait a little for the first."""
    found: list[TrackEvent] = []
    while len(found) < AT_ONCE:
        event = events.take(0.0 if found else TAKE_S)
        if not isinstance(event, TrackEvent):
            return found
        found.append(event)
    return found
