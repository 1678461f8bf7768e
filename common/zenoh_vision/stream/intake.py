"""Turns samples into messages, frames or counted drops, the same for every transport.

A transport calls ``receive`` on its thread, where only header, size and order are checked. The
consumer calls ``take`` on its own thread, where pictures and messages are decoded.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.keys import RouteName
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
        route: How the last frame came; None before the first.
    """

    key: str
    since_ns: int
    late_since_ns: int | None = None
    offset_ns: int | None = None
    stream: str = ""
    route: RouteName | None = None


@dataclass(frozen=True, slots=True)
class Consumer:
    """The state that the inputs of one consumer share.

    Attributes:
        counters: Count arrivals and drops; the consumer counts what it has processed.
        dropped: Called with the reason of each drop, for the log.
        filled: Set on the transport's thread when there is something to take.
        clock: What the age of frames is measured by.
    """

    counters: FrameCounters
    dropped: Callable[[PayloadError], None]
    filled: Wakeup = field(default_factory=Wakeup)
    clock: Clock = SYSTEM_CLOCK


class Intake(ABC, Generic[Waiting, Item]):
    """Receives the samples of one key or key expression.

    Args:
        key: Key expression, which may have wildcards.
        consumer: Takes the items.
        buffering: How many items wait for the consumer.
        limit: Of the size of a payload.
        deletions: Whether deletions are taken too; else they are dropped as ``empty``.
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
        self._single = "*" not in key
        self.limit = limit
        self._deletions = deletions
        self._counters = consumer.counters
        self._dropped = consumer.dropped
        self.clock = consumer.clock
        reason = buffering.reason
        self.buffer = Buffer[Waiting](
            buffering, lambda _: self._counters.drop(reason), consumer.filled
        )

    # On the transport's thread

    def receive(self, sample: Sample) -> bool:
        """Check a sample and queue it for the consumer, or drop it.

        Returns:
            Whether it is good, so that its route delivers: it was queued, or came before by another
            route.
        """
        self._counters.arrive()
        size = len(sample.payload)
        stream = self.key if self._single else sample.key
        try:
            self.limit.check(size, sample.encoding)
            if sample.deleted and not self._deletions:
                raise PayloadError("empty", "a deletion")
            item, unverified = self._check(sample, stream)
        except PayloadError as error:
            self._counters.drop(error.reason)
            if error.reason == "duplicate":  # which is no fault
                return True
            self._dropped(error)
            return False
        self.buffer.put(item, stream, unverified=unverified, size=size)
        return True

    def reject(self, error: PayloadError) -> None:
        """Count an arrival that the transport could not turn into a sample."""
        self._counters.arrive()
        self._drop(error)

    # On the consumer's thread

    @property
    def keys(self) -> tuple[str, ...]:
        """The key expressions that are subscribed to, for the node's description."""
        return (self.key,)

    @property
    def fault(self) -> str:
        """Why items do not come as they should, for the node's health; empty if they do."""
        return ""

    def states(self) -> Sequence[InputState]:
        """Return the state of each key whose silence is a fault; none, except for frames."""
        return ()

    def close(self, unread: str | None = None) -> None:
        """Drop the items that wait or are on their way, and wake the consumer.

        Args:
            unread: The reason under which they are counted as dropped; None leaves them pending,
                for a node that ends with its input.
        """

        def drop(_item: Waiting) -> None:
            if unread is not None:
                self._counters.drop(unread)

        self.buffer.close(drop)

    def _drop(self, error: PayloadError) -> None:
        self._counters.drop(error.reason)
        self._dropped(error)

    @abstractmethod
    def take(self, timeout_s: float) -> Item | None:
        """Return the next item, which is then pending; None after the time-out, or if it is bad."""

    @abstractmethod
    def _check(self, sample: Sample, stream: str) -> tuple[Waiting, bool]:
        """Return the item to queue, and whether its epoch is unverified; PayloadError drops it.

        Args:
            sample: As it arrived.
            stream: Its key; without wildcards, that of the intake.
        """


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
        """Return the next sample; None after the time-out."""
        return self.buffer.take(timeout_s)

    def _check(self, sample: Sample, _stream: str) -> tuple[Sample, bool]:
        return sample, False


class MessageIntake(Intake[tuple[bytes, type[Message]], Message]):
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
        item = self.buffer.take(timeout_s)
        if item is None:
            return None
        payload, message = item
        try:
            return message.from_bytes(payload)
        except PayloadError as error:
            self._drop(error)
            return None

    def _check(self, sample: Sample, _stream: str) -> tuple[tuple[bytes, type[Message]], bool]:
        message = self._message or MESSAGES.get(keys.schema_name_of(sample.encoding))
        if message is None:
            raise PayloadError("unknown_message", f"{sample.key} carries {sample.encoding!r}")
        return (bytes(sample.payload), message), False
