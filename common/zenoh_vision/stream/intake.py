"""Turns samples into messages, frames or counted drops, the same for every transport.

A transport calls ``receive`` on its thread, where only header, size and order are checked. The
consumer calls ``take`` on its own thread, where pictures and messages are decoded.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.keys import Way
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES
from zenoh_vision.stream.buffer import Buffer, Buffering, check_buffering, latest
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.sample import MESSAGE_LIMIT, RAW_LIMIT, Sample, SizeLimit

Item = TypeVar("Item")
Waiting = TypeVar("Waiting")


@dataclass(frozen=True, slots=True)
class InputState:
    """State of one key of an input, for the node's health. Times are monotonic.

    Attributes:
        key: The key; while none is known, the input's key expression, or the keys it can be.
        since_ns: Last good arrival; before the first, when the input was opened.
        late_since_ns: Since when every frame has been stale; None if the last one was not.
        offset_ns: The least ``now - stamp`` of the last minute; None if unknown.
        stream: Name that stays the same when a stream changes its key; empty if it is the key.
        way: How the last frame arrived; None before the first.
    """

    key: str
    since_ns: int
    late_since_ns: int | None = None
    offset_ns: int | None = None
    stream: str = ""
    way: Way | None = None


@dataclass(frozen=True, slots=True)
class Consumer:
    """The state that the inputs of one consumer share.

    Attributes:
        counters: Count arrivals and drops; the consumer counts what it has processed.
        dropped: Called with the reason of each drop, for the log.
        arrived: Called on the transport's thread when there is something to take.
        filled: Set when there is something to take.
    """

    counters: FrameCounters
    dropped: Callable[[PayloadError], None]
    arrived: Callable[[], None] = lambda: None
    filled: Wakeup = field(default_factory=Wakeup)


class Intake(ABC, Generic[Waiting, Item]):
    """Receives the samples of one key or key expression.

    Args:
        key: Key expression, which may have wildcards.
        consumer: Takes the items.
        buffering: How many items wait for the consumer.
        limit: Of the size of a payload.
        deletions: Whether deletions are taken too; else they are dropped as ``empty``.

    Attributes:
        keys: The key expressions that are subscribed to: its own, or those of its transports.
        fault: Why items do not come by the intended transport, for the node's health; empty if they
            do.
    """

    def __init__(
        self,
        key: str,
        consumer: Consumer,
        buffering: Buffering,
        limit: SizeLimit,
        *,
        deletions: bool = False,
    ) -> None:
        check_buffering(buffering)
        self.key = key
        self.keys: tuple[str, ...] = (key,)
        self.fault = ""
        self.limit = limit
        self._deletions = deletions
        self._counters = consumer.counters
        self._dropped = consumer.dropped
        self._arrived = consumer.arrived
        self._release_taken: Callable[[], None] | None = None
        self._release_lock = threading.Lock()  # ``close`` may come from any thread
        self._closed = False
        self._unread: str | None = None
        reason = buffering.reason
        self.buffer = Buffer[tuple[Sample, Waiting]](
            buffering, lambda item: self._discard(item[0], reason), consumer.filled
        )

    # On the transport's thread

    def limit_of(self, key: str) -> SizeLimit:  # noqa: ARG002 - for those that distinguish
        """Return the limit of the size of a payload on a key."""
        return self.limit

    def receive(self, sample: Sample) -> None:
        """Check a sample and queue it for the consumer, or drop it."""
        self._counters.arrive()
        size = len(sample.payload)
        try:
            self.limit_of(sample.key).check(size)
            if sample.deleted and not self._deletions:
                raise PayloadError("empty", "a deletion")
            item, unverified = self._check(sample)
        except PayloadError as error:
            self._discard(sample, error.reason)
            if error.reason != "duplicate":  # a frame arrived by two transports, which is no fault
                self._dropped(error)
            return
        stream = self._stream_key(sample.key)
        self.buffer.put((sample, item), stream, unverified=unverified, size=size)
        if self._closed:  # it was on its way when the subscription ended
            self._discard_waiting()
        else:
            self._arrived()

    def reject(self, error: PayloadError) -> None:
        """Count an arrival that the transport could not turn into a sample."""
        self._counters.arrive()
        self._drop(error)

    # On the consumer's thread

    def states(self) -> Sequence[InputState]:
        """Return the state of each key whose silence is a fault; none, except for frames."""
        return ()

    def close(self, unread: str | None = None) -> None:
        """Release the memory of all samples, waiting or taken.

        Args:
            unread: The reason under which the waiting items are counted as dropped; None leaves
                them pending, for a node that ends with its input.
        """
        self._unread = unread  # before it is closed, since another thread may then read it
        with self._release_lock:
            self._closed = True
        self._release()
        self._discard_waiting()

    def _stream_key(self, key: str) -> str:
        """Return the key of the stream to which the samples on a key belong."""
        return key

    def _discard_waiting(self) -> None:
        while (item := self.buffer.take(0)) is not None:
            self._discard(item[0], self._unread)

    def _next(self, timeout_s: float) -> tuple[Sample, Waiting] | None:
        self._release()
        item = self.buffer.take(timeout_s)
        if item is None:
            return None
        with self._release_lock:
            if not self._closed:
                self._release_taken = item[0].release
                return item
        self._discard(item[0], self._unread)  # it was closed meanwhile
        return None

    def _release(self) -> None:
        with self._release_lock:
            release, self._release_taken = self._release_taken, None
        if release is not None:
            release()

    def _discard(self, sample: Sample, reason: str | None) -> None:
        if reason is not None:
            self._counters.drop(reason)
        if sample.release is not None:
            sample.release()

    def _drop(self, error: PayloadError) -> None:
        self._counters.drop(error.reason)
        self._dropped(error)

    @abstractmethod
    def _check(self, sample: Sample) -> tuple[Waiting, bool]:
        """Return the item to queue, and whether its epoch is unverified; PayloadError drops it."""


class SampleIntake(Intake[Sample, Sample]):
    """Samples as they came, with only their size checked: for a recorder of any keys."""

    def __init__(
        self,
        key: str,
        consumer: Consumer,
        buffering: Buffering = latest,
        *,
        limit: SizeLimit = RAW_LIMIT,
        deletions: bool = True,
    ) -> None:
        super().__init__(key, consumer, buffering, limit, deletions=deletions)

    def take(self, timeout_s: float) -> Sample | None:
        """Return the next sample, which is then pending; None after the time-out."""
        item = self._next(timeout_s)
        return None if item is None else item[0]

    def _check(self, sample: Sample) -> tuple[Sample, bool]:
        return sample, False


class MessageIntake(Intake[type[Message], Message]):
    """Messages, decoded and checked against their class.

    ``message`` is their class; None takes the one that the sample's encoding names.
    """

    def __init__(
        self,
        key: str,
        consumer: Consumer,
        buffering: Buffering = latest,
        *,
        message: type[Message] | None = None,
    ) -> None:
        super().__init__(key, consumer, buffering, MESSAGE_LIMIT)
        self._message = message

    def take(self, timeout_s: float) -> Message | None:
        """Return the next message; None after the time-out, or if it was malformed."""
        item = self._next(timeout_s)
        if item is None:
            return None
        sample, message = item
        try:
            return message.from_bytes(bytes(sample.payload))
        except PayloadError as error:
            self._drop(error)
            return None

    def _check(self, sample: Sample) -> tuple[type[Message], bool]:
        message = self._message or MESSAGES.get(keys.schema_name_of(sample.encoding))
        if message is None:
            raise PayloadError("unknown_message", f"{sample.key} carries {sample.encoding!r}")
        return message, False
