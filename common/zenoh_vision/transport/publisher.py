"""Publishers of one key: payloads are made on demand; the newest is kept for queries."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import zenoh

from zenoh_vision.image import codecs
from zenoh_vision.image.bits import pack_bits
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import BITS, JPEG, PNG, msgpack_of
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Header, Stamped
from zenoh_vision.topics import Topic
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.session import direct


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A payload to publish, with its Zenoh encoding and the header's bytes as attachment."""

    payload: bytes
    encoding: str
    attachment: bytes | None = None

    @classmethod
    def message(cls, message: Message) -> Outgoing:
        """Encode a message; its header, if it has one, is also the attachment."""
        attachment = message.header.to_bytes() if isinstance(message, Stamped) else None
        return cls(message.to_bytes(), msgpack_of(message.schema_name), attachment)


def encoded_picture(
    pixels: Pixels,
    header: Header,
    *,
    jpeg_quality: int | None,
    bilevel: bool,
    bits: bool = False,
) -> Outgoing:
    """Encode 8-bit pixels as JPEG, or as PNG if ``jpeg_quality`` is None; see ``Outputs``."""
    attachment = header.to_bytes()
    if bits:
        return Outgoing(pack_bits(np.asarray(pixels, np.uint8)), BITS, attachment)
    if jpeg_quality is None:
        return Outgoing(codecs.encode_png(pixels, bilevel=bilevel), PNG, attachment)
    jpeg = codecs.encode_jpeg(pixels, header.encoding or "bgr8", jpeg_quality)
    return Outgoing(jpeg, JPEG, attachment)


class LazyPayload:
    """A payload that is made on first use, and only once; safe between threads.

    ``timestamp`` is that of its reply to a query, if several payloads are kept.
    """

    __slots__ = ("_lock", "_made", "_make", "timestamp")

    def __init__(
        self, make: Callable[[], Outgoing], timestamp: zenoh.Timestamp | None = None
    ) -> None:
        self.timestamp = timestamp
        self._make: Callable[[], Outgoing] | None = make
        self._made: Outgoing | None = None
        self._lock = threading.Lock()

    def __call__(self) -> Outgoing:
        """Return the payload; make it first if needed."""
        with self._lock:
            if self._make is not None:
                self._made = self._make()
                self._make = None  # releases what it was made from
            assert self._made is not None
            return self._made


FRAME_DELIVERY = (zenoh.CongestionControl.BLOCK_FIRST, zenoh.Priority.DATA)
MESSAGE_DELIVERY = (zenoh.CongestionControl.BLOCK, zenoh.Priority.INTERACTIVE_HIGH)


LOOK_NS = 100_000_000
"""How often Zenoh is asked whether someone subscribes to a key."""


class Demand:
    """Whether someone subscribes to the key of a publisher.

    Zenoh is asked again after ``LOOK_NS`` only, since a look at it takes longer than anything else
    that is done for a frame that nobody wants.
    """

    def __init__(self, publisher: Declaration[zenoh.Publisher]) -> None:
        self._publisher = publisher
        self._exists = False
        self._look_ns = 0

    @property
    def exists(self) -> bool:
        """Whether someone subscribed, at the last look."""
        now_ns = time.monotonic_ns()
        if now_ns >= self._look_ns:
            self._look_ns = now_ns + LOOK_NS
            self._exists = bool(self._publisher.current.matching_status.matching)  # type: ignore[attr-defined]
        return self._exists


MayReply = Callable[[int], str]
"""Returns why a reply of this many bytes must not be sent now; empty if it may be sent."""


class StreamPublisher:
    """Publishes one key and answers queries with its newest payload, or with several of them.

    Args:
        topic: Says how the samples are encoded and delivered.
        key: Full key expression.
        queue_query: Called on Zenoh's thread with each query and the function that answers it;
            must return at once.

    Attributes:
        may_reply: Called before each reply, on the thread of queries. A text that it returns is
            sent as an error instead.
    """

    def __init__(
        self,
        link: Link,
        topic: Topic,
        key: str,
        queue_query: Callable[[zenoh.Query, Callable[[zenoh.Query], None]], None],
    ) -> None:
        self.topic = topic
        self.key = key
        congestion_control, priority = (
            FRAME_DELIVERY if topic.delivery == "frame" else MESSAGE_DELIVERY
        )
        self.may_reply: MayReply = lambda _: ""
        self._link = link
        self._kept: deque[LazyPayload] = deque(maxlen=topic.keeps)
        self._publisher = link.declare(
            lambda session: session.declare_publisher(
                key,
                encoding=topic.encoding,
                congestion_control=congestion_control,
                priority=priority,
            )
        )
        self._demand = Demand(self._publisher)
        link.declare(
            lambda session: session.declare_queryable(
                key, direct(lambda query: queue_query(query, self.answer)), complete=True
            )
        )

    @property
    def wanted(self) -> bool:
        """Whether someone subscribes to the key."""
        return self._demand.exists

    def offer(
        self, make: Callable[[], Outgoing], may_send: Callable[[], bool] = lambda: True
    ) -> bool:
        """Publish ``make()`` if someone subscribes, and keep it as the newest for queries.

        Args:
            make: Makes the payload; called at most once.
            may_send: Called before a payload is published; if False, it is not kept either.

        Returns:
            Whether it was published. A topic that is not lazy always is.
        """
        to_send = not self.topic.lazy or self.wanted
        if to_send and not may_send():
            return False
        several = self.topic.keeps > 1
        newest = LazyPayload(make, self._link.session.new_timestamp() if several else None)
        self._kept.append(newest)
        if not to_send:
            return False
        outgoing = newest()
        self._publisher.current.put(
            outgoing.payload, encoding=outgoing.encoding, attachment=outgoing.attachment
        )
        return True

    def answer(self, query: zenoh.Query) -> None:
        """Reply with the newest payloads, oldest first; no reply if there is none yet.

        All replies have the same key, of which a client keeps only the newest by default: that of
        the latest timestamp, or without timestamps the last.
        """
        for kept in tuple(self._kept):
            sent = kept()
            refusal = self.may_reply(len(sent.payload))
            if refusal:
                query.reply_err(refusal.encode(), encoding="text/plain")
                return
            query.reply(
                self.key,
                sent.payload,
                encoding=sent.encoding,
                attachment=sent.attachment,
                timestamp=kept.timestamp,
            )
