"""The messages of one key: decoded once, with a short queue for every client."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Collection

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import schema_name_of
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES, unpack
from zenoh_vision.messages import MESSAGES, Header
from zenoh_vision.stream.buffer import Buffering
from zenoh_vision.stream.intake import Consumer, SampleIntake
from zenoh_vision.stream.sample import SizeLimit
from zv.viewer import events
from zv.viewer.discovery.network import SLICE_S
from zv.viewer.streams.shared_stream import OnClosed, SharedStream, StreamContext
from zv.viewer.topics import kind_of

QUEUE = 64
"""Limit of messages queued for one client; beyond it the oldest is dropped."""

BUFFERING = Buffering(QUEUE, per_key=False, reason="overwritten", max_bytes=8 << 20)
LIMIT = SizeLimit(MAX_MESSAGE_BYTES, "bad_message")
MOST_DECODED = 64 << 10
"""Bytes of a message whose fields pages get. Of a larger one they get its size and header."""

MAX_CONTAINERS = 10_000
"""Limit of the maps and lists in a message. With both, 64 messages can be queued, and one is
converted in some milliseconds."""


class MessageStream(SharedStream[SampleIntake]):
    """Fans out the messages of a key."""

    def __init__(self, context: StreamContext, key: str, on_closed: OnClosed) -> None:
        super().__init__(context, key, on_closed)
        self.feeds: set[MessageFeed] = set()

    def _new_intake(self, consumer: Consumer) -> SampleIntake:
        return SampleIntake(self.key, consumer, BUFFERING, limit=LIMIT, deletions=False)

    def _receive(self, intake: SampleIntake) -> None:
        end_s = time.monotonic() + SLICE_S
        while time.monotonic() < end_s:
            sample = intake.take(0)
            if sample is None:
                return
            payload = bytes(sample.payload)
            try:
                if len(payload) > MOST_DECODED:
                    text, stamp_ns = large_text(self.key, len(payload), sample.attachment)
                else:
                    text, stamp_ns = message_text(self.key, payload, sample.encoding)
            except PayloadError as error:
                self._context.drop(error)
                continue
            for feed in self.feeds:
                feed.put(text)
            self._context.processed(stamp_ns)
        self._context.network.loop.call_soon(self._on_arrival)


class MessageFeed:
    """The queue of one client: the last 64 messages that it has not taken yet."""

    def __init__(self, stream: MessageStream, ready: asyncio.Event) -> None:
        self._stream = stream
        self._ready = ready
        self._waiting: deque[str] = deque(maxlen=QUEUE)
        stream.feeds.add(self)

    def put(self, text: str) -> None:
        """Add a message; the oldest is dropped if there are too many."""
        self._waiting.append(text)
        self._ready.set()

    def take(self, most: int) -> list[str]:
        """Return and remove the oldest messages, at most ``most``."""
        return [self._waiting.popleft() for _ in range(min(most, len(self._waiting)))]

    def close(self) -> None:
        """End the feed; the subscription ends with the last feed."""
        self._stream.feeds.discard(self)
        if not self._stream.feeds and not self._stream.closed:
            self._stream.close()


def message_text(key: str, payload: bytes, encoding: str = "") -> tuple[str, int | None]:
    """Return a message as a page gets it, and its frame's capture time, ns since 1970.

    Its class follows from the key, if that is in the topic table, else from its encoding; a
    message of an unknown class may be any map. Fields that its class does not know are passed on.

    Raises:
        PayloadError: ``bad_message``: it is not a msgpack map, not valid for its class, or has too
            many parts.
    """
    fields = unpack(payload)
    if not isinstance(fields, dict):
        raise PayloadError("bad_message", f"{type(fields).__name__} instead of a map")
    name = kind_of(key).type or schema_name_of(encoding)
    expected = MESSAGES.get(name)
    if expected is not None:
        expected.from_map(fields)
    if len(payload) > MAX_CONTAINERS:  # each takes at least a byte
        _check_containers(fields)
    header = fields.get("header")
    body = {name: value for name, value in fields.items() if name != "header"}
    stamp_ns = header.get("stamp_ns") if isinstance(header, dict) else None
    text = events.text("message", key=key, type=name, header=header, body=body)
    return text, stamp_ns if isinstance(stamp_ns, int) else None


def large_text(key: str, size: int, attachment: bytes | None) -> tuple[str, int | None]:
    """Return what a page gets of a message that is too large to be decoded for it.

    Raises:
        PayloadError: ``bad_header``: its attachment is none.
    """
    header = None if attachment is None else Header.from_bytes(attachment)
    about = None if header is None else header.to_map()
    text = events.text("large", key=key, bytes=size, header=about)
    return text, None if header is None else header.stamp_ns


def _check_containers(fields: dict[object, object]) -> None:
    found: list[Collection[object]] = [fields]
    for value in found:  # it grows during the loop
        inner = value.values() if isinstance(value, dict) else value
        found.extend(each for each in inner if isinstance(each, (dict, tuple)))
        if len(found) > MAX_CONTAINERS:
            raise PayloadError("bad_message", f"more than {MAX_CONTAINERS} maps and lists")
