"""Publishers of one key: payloads are made on demand; the newest is kept for queries."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import msgpack_of
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Stamped
from zenoh_vision.topics import Topic
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.session import direct

Outcome = Literal["sent", "unwanted", "withheld"]
"""What became of a payload: it was sent, nobody subscribes, or its maker withheld it."""


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A payload to publish, with its Zenoh encoding and the header's bytes as attachment.

    ``answers``: Whether it may answer queries, since it can be read without those before it.
    """

    payload: bytes
    encoding: str
    attachment: bytes | None = None
    answers: bool = True

    @classmethod
    def message(cls, message: Message) -> Outgoing:
        """Encode a message; its header, if it has one, is also the attachment."""
        attachment = message.header.to_bytes() if isinstance(message, Stamped) else None
        return cls(message.to_bytes(), msgpack_of(message.schema_name), attachment)


class LazyPayload:
    """A payload that was made, or is made when a query asks for it; used by one thread.

    Attributes:
        made: The payload, or why it cannot be made; None before.
        make: Makes it; None once it was called.
        timestamp: That of the reply to a query, if several payloads are kept.
    """

    __slots__ = ("made", "make", "timestamp")

    made: Outgoing | Exception | None
    make: Callable[[], Outgoing] | None
    timestamp: zenoh.Timestamp | None

    def __call__(self) -> Outgoing:
        """Return the payload; make it first if needed. One that cannot be made is tried once."""
        if self.make is not None:
            try:
                self.made = self.make()
            except Exception as error:
                self.made = error
            self.make = None  # releases what it was made from
        if isinstance(self.made, Exception):
            raise self.made.with_traceback(None)
        assert self.made is not None
        return self.made


FRAME_DELIVERY = (zenoh.CongestionControl.BLOCK_FIRST, zenoh.Priority.DATA)
MESSAGE_DELIVERY = (zenoh.CongestionControl.BLOCK, zenoh.Priority.INTERACTIVE_HIGH)


class Demand:
    """Whether someone subscribes to the key of a publisher, as Zenoh says when that changes."""

    def __init__(self) -> None:
        self.exists = False
        self._newest = self._followed = [False]  # what was said of the publishers
        self._lock = threading.Lock()

    def of(self, publisher: zenoh.Publisher) -> zenoh.Publisher:
        """Have Zenoh tell of a publisher, which counts from ``follow_newest`` on; return it."""
        self._newest = told = [False]

        def note(status: zenoh.MatchingStatus) -> None:
            with self._lock:
                told[0] = status.matching
                if told is self._followed:
                    self.exists = status.matching

        publisher.declare_matching_listener(direct(note))
        return publisher

    def follow_newest(self) -> None:
        """Follow the publisher of a session that is used now, not that of the one before."""
        with self._lock:
            self._followed = self._newest
            self.exists = self._followed[0]


FrameId = tuple[int, int]
"""Epoch and sequence number of a frame."""

RECENT_BYTES = 32 << 20
"""Limit of what the payloads of recent frames take, except the newest."""

ReplyLimit = Callable[[int], str | None]
"""Returns why a reply of this many bytes must not be sent now; None if it may be."""


class StreamPublisher:
    """Publishes one key and answers queries with its newest payload, or with several of them.

    Args:
        topic: Says how the samples are encoded and delivered.
        key: Full key expression.
        queue_query: Called on Zenoh's thread with each query and the function that answers it;
            must return at once.
        report: Called with what is wrong with a payload that cannot be made for a query.

    Attributes:
        demand: Whether someone subscribes to the key.
        limit: Called before each reply, on the thread of queries. A text that it returns is sent as
            an error instead.
    """

    def __init__(
        self,
        link: Link,
        topic: Topic,
        key: str,
        queue_query: Callable[[zenoh.Query, Callable[[zenoh.Query], None]], None],
        report: Callable[[PayloadError], None] = lambda _: None,
    ) -> None:
        self.topic = topic
        self.key = key
        congestion_control, priority = (
            FRAME_DELIVERY if topic.delivery == "frame" else MESSAGE_DELIVERY
        )
        self.limit: ReplyLimit = lambda _: None
        self._link = link
        self._report = report
        self._kept: deque[LazyPayload] = deque(maxlen=topic.keeps)
        self._recent: deque[tuple[FrameId, LazyPayload, int]] = deque()
        self._recent_bytes = 0
        self.demand = Demand()
        self._publisher = link.declare(
            lambda session: self.demand.of(
                session.declare_publisher(
                    key,
                    encoding=topic.encoding,
                    congestion_control=congestion_control,
                    priority=priority,
                )
            ),
            self.demand.follow_newest,
        )
        link.declare(
            lambda session: session.declare_queryable(
                key, direct(lambda query: queue_query(query, self.answer)), complete=True
            )
        )

    def offer(
        self,
        make: Callable[[], Outgoing],
        send: Callable[[], Outgoing | None] | None = None,
        frame: FrameId | None = None,
        held: int = 0,
    ) -> Outcome:
        """Publish a payload if someone subscribes, and keep it as the newest for queries.

        Args:
            make: Makes the payload; called at most once, perhaps later and on another thread.
            send: Makes the one to send now, if it differs from what a query gets; None withholds
                it, and it is not kept either. By default ``make``.
            frame: To which it belongs, if a query may name it.
            held: Bytes that ``make`` needs until it is called.

        Returns:
            What became of it. A topic that is not lazy is always sent.
        """
        topic, outgoing = self.topic, None
        if self.demand.exists or not topic.lazy:
            outgoing = (send or make)()
            if outgoing is None:
                return "withheld"
            held = len(outgoing.payload)
        if outgoing is None or outgoing.answers:
            kept = LazyPayload()
            kept.made, kept.make = outgoing, make if outgoing is None else None
            kept.timestamp = self._link.session.new_timestamp() if topic.keeps > 1 else None
            self._kept.append(kept)
            if frame is not None and topic.recent:
                recent = self._recent
                recent.append((frame, kept, held))
                self._recent_bytes += held
                while len(recent) > 1 and (
                    len(recent) > topic.recent or self._recent_bytes > RECENT_BYTES
                ):
                    self._recent_bytes -= recent.popleft()[2]
        if outgoing is None:
            return "unwanted"
        self._put(outgoing)
        return "sent"

    def answer(self, query: zenoh.Query) -> None:
        """Reply with the newest payloads, oldest first; no reply if there is none yet.

        All replies have the same key, of which a client keeps only the newest by default: that of
        the latest timestamp, or without timestamps the last. A payload that cannot be made is an
        error reply. A query with the parameters ``epoch`` and ``seq`` gets the payload of that
        frame instead, if it is there still.
        """
        named = (query.parameters.get("epoch"), query.parameters.get("seq"))
        recent = (kept for frame, kept, _ in tuple(self._recent) if tuple(map(str, frame)) == named)
        for kept in tuple(recent) or tuple(self._kept):
            try:
                sent = kept()
            except Exception as error:
                self._report(_fault_of(error))
                query.reply_err(f"{self.key}: {error}".encode(), encoding="text/plain")
                return
            if not sent.answers:
                continue
            if (refusal := self.limit(len(sent.payload))) is not None:
                query.reply_err(refusal.encode(), encoding="text/plain")
                return
            query.reply(
                self.key,
                sent.payload,
                encoding=sent.encoding,
                attachment=sent.attachment,
                timestamp=kept.timestamp,
            )

    def _put(self, outgoing: Outgoing) -> None:
        publisher = self._publisher.current
        try:
            publisher.put(
                outgoing.payload, encoding=outgoing.encoding, attachment=outgoing.attachment
            )
        except zenoh.ZError:
            if self._publisher.current is publisher:
                raise
            # The session was replaced meanwhile, and the former one is closed.
            self._publisher.current.put(
                outgoing.payload, encoding=outgoing.encoding, attachment=outgoing.attachment
            )


def _fault_of(error: Exception) -> PayloadError:
    if isinstance(error, PayloadError):
        return error
    return PayloadError("not_made", f"{type(error).__name__}: {error}")
