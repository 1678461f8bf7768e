"""One key's messages, fanned out: each decoded once, a short queue for every client."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

import zenoh

from common.codec import Message, unpack
from common.errors import PayloadError
from common.link import Declaration, Link
from common.messages import CameraInfo, Centroid, TrackEvent, Tracks
from common.session import direct
from services.viewer import wire
from services.viewer.topics import kind_of

if TYPE_CHECKING:
    from services.viewer.hub import Hub

QUEUE = 64
"""Messages that wait for one client; the oldest gives way."""

MAX_BYTES = 256 << 10
CLASSES: dict[str, type[Message]] = {
    message.schema_name: message for message in (Centroid, Tracks, TrackEvent, CameraInfo)
}


class Messages:
    """A key's messages while somebody watches; on the browsers' loop.

    Args:
        key: Full key expression.
        hub: Whose stream it is.
    """

    def __init__(self, key: str, hub: Hub) -> None:
        self.key = key
        self.hub = hub
        self._feeds: set[MessageFeed] = set()
        self._subscriber: Declaration[zenoh.Subscriber[None]] | None = None
        self._arrived: deque[tuple[bytes, str]] = deque()
        self._woken = False
        self._ended = False

    def declare(self) -> None:
        """Subscribe, if there is a session."""
        self.hub.network.do(self._declare)

    def end(self) -> None:
        """Unsubscribe."""
        self._ended = True
        self.hub.network.do(lambda _: self._undeclare())

    def _declare(self, link: Link) -> None:
        if not self._ended and self._subscriber is None:
            self._subscriber = link.declare(
                lambda session: session.declare_subscriber(self.key, direct(self._on_sample))
            )

    def _undeclare(self) -> None:
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            subscriber.undeclare()

    def feed(self, ready: Callable[[], None]) -> MessageFeed:
        """Return what one more client gets its messages from."""
        feed = MessageFeed(self, ready)
        self._feeds.add(feed)
        return feed

    def leave(self, feed: MessageFeed) -> None:
        """Take a client's leave; the last one's ends the stream."""
        self._feeds.discard(feed)
        if not self._feeds and not self._ended:
            self.hub.forget(self)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        """Leave a message for the loop, on Zenoh's thread; too many drop the oldest."""
        ledger = self.hub.ledger
        ledger.arrive()
        if sample.kind != zenoh.SampleKind.PUT or len(sample.payload) > MAX_BYTES:
            ledger.drop("bad_message")
            return
        self._arrived.append((sample.payload.to_bytes(), str(sample.encoding)))
        while len(self._arrived) > QUEUE:
            try:
                self._arrived.popleft()
            except IndexError:
                break
            ledger.drop("overwritten")
        if not self._woken:
            self._woken = True
            try:
                self.hub.loop.call_soon_threadsafe(self._take)
            except RuntimeError:  # the loop has ended
                return

    def _take(self) -> None:
        self._woken = False
        while True:
            try:
                payload, encoding = self._arrived.popleft()
            except IndexError:
                return
            if not self._feeds:
                self.hub.ledger.drop("unwatched")
                continue
            try:
                text, stamp_ns = message_text(self.key, payload, encoding)
            except PayloadError as error:
                self.hub.ledger.drop(error.reason)
                self.hub.health.complain(error)
                continue
            for feed in self._feeds:
                feed.put(text)
            self.hub.ledger.finish()
            if stamp_ns is not None:
                late_ms = (time.time_ns() - stamp_ns) / 1e6
                self.hub.health.pace.note(time.monotonic(), late_ms)


class MessageFeed:
    """What one client gets of a stream of messages: the last 64 that it has not got yet.

    Args:
        stream: The messages.
        ready: Called when there is one to take.
    """

    def __init__(self, stream: Messages, ready: Callable[[], None]) -> None:
        self.stream = stream
        self._ready = ready
        self._waiting: deque[str] = deque(maxlen=QUEUE)

    def put(self, text: str) -> None:
        """Leave a message."""
        self._waiting.append(text)
        self._ready()

    def take(self) -> str | None:
        """Return the oldest that waits."""
        return self._waiting.popleft() if self._waiting else None

    def close(self) -> None:
        """Want no more."""
        self.stream.leave(self)


def message_text(key: str, payload: bytes, encoding: str = "") -> tuple[str, int | None]:
    """Return a message as a page gets it, and its frame's capture time, ns since 1970.

    What it must be is said by the key, if that is in the topic table, else by its encoding; a
    message of another's class may be any map. Fields that its class does not know are passed on.

    Args:
        key: Full key expression.
        payload: The msgpack map.
        encoding: Of the sample, as Zenoh spells it.

    Raises:
        PayloadError: ``bad_message``: it is no msgpack map, or none of its class.
    """
    fields = unpack(payload)
    if not isinstance(fields, dict):
        raise PayloadError("bad_message", f"{type(fields).__name__} instead of a map")
    expected = CLASSES.get(kind_of(key).type or encoding.partition(";")[2])
    if expected is not None:
        expected.from_map(fields)
    header = fields.get("header")
    body = {name: value for name, value in fields.items() if name != "header"}
    stamp_ns = header.get("stamp_ns") if isinstance(header, dict) else None
    text = wire.text("message", key=key, header=header, body=body)
    return text, stamp_ns if isinstance(stamp_ns, int) else None
