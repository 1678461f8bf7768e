"""Buffers between the thread that receives items and the one that takes them."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from zenoh_vision.host.wakeup import Wakeup

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Buffering:
    """The limit of queued items, and which one is dropped when a newer one arrives.

    Attributes:
        depth: Largest number of waiting items.
        per_key: Whether the newest item of each key waits instead, which needs a depth of 1.
        reason: Items that a newer one replaced are counted as ``dropped.{reason}``.
        max_bytes: Largest number of waiting bytes. The newest item may exceed it alone.
    """

    depth: int
    per_key: bool
    reason: str
    max_bytes: float = math.inf


latest = Buffering(1, per_key=True, reason="overwritten")
"""The newest item of each key; a newer one replaces it (``dropped.overwritten``)."""


QUEUE_BYTES = 256 << 20
"""Most bytes that wait, of a queue or of all keys; a key's newest item may exceed it alone."""

MAX_KEYS = 1000
"""Most keys that have items waiting; anyone can publish on any number of them."""


def queue(depth: int, max_bytes: int = QUEUE_BYTES) -> Buffering:
    """Return a queue of at least 1 item; when full, it drops the oldest (``dropped.overflow``).

    It is full when ``depth`` items wait, or payloads of ``max_bytes`` in total.

    Raises:
        ValueError: ``depth`` is below 1.
    """
    if depth < 1:
        raise ValueError(f"a queue of {depth} items; at least 1 is needed")
    return Buffering(depth, per_key=False, reason="overflow", max_bytes=max_bytes)


def check_buffering(buffering: object) -> None:
    """Check that an argument is a ``Buffering``, since a mere number is easily passed.

    Raises:
        TypeError: It is not.
    """
    if not isinstance(buffering, Buffering):
        raise TypeError(f"buffering={buffering!r}; allowed: latest, queue(n)")


class Buffer(Generic[T]):
    """Items of one input, oldest first; safe between threads.

    Items of an unverified epoch wait in a separate queue, so that they do not replace those of the
    current epoch; verified items are taken first.

    Args:
        buffering: The limits, and which items they apply to.
        dropped: Called with each item that a newer one replaced.
        wakeup: Set with each new item; shared by buffers that one consumer waits for.

    Attributes:
        filled: Whether an item waits.
    """

    def __init__(
        self,
        buffering: Buffering,
        dropped: Callable[[T], None],
        wakeup: Wakeup | None = None,
    ) -> None:
        self.filled = False
        self._buffering = buffering
        self._dropped = dropped
        self._wakeup = wakeup or Wakeup()
        self._closed = False
        self._lock = threading.RLock()  # reentrant: room is made by taking
        # Items with their sizes, by key and whether unverified. A newer item takes the place of the
        # one that it replaces, so the queues are in the order of their oldest items.
        self._queues: dict[tuple[str, bool], deque[tuple[int, T]]] = {}
        self._bytes = 0  # of all items

    def put(self, item: T, key: str = "", *, unverified: bool = False, size: int = 0) -> None:
        """Add an item of ``size`` bytes; drop the oldest of its queue while that is full.

        Of a closed buffer it is dropped itself.
        """
        limits = self._buffering
        # With ``queue``, all items share one queue, so that their order is kept.
        queue_key = (key, unverified) if limits.per_key else ("", False)
        replaced: list[Any] = []
        with self._lock:
            if queue_key not in self._queues and len(self._queues) >= MAX_KEYS:
                replaced.append(self.take(0))
            items = self._queues.setdefault(queue_key, deque())
            while items and (len(items) == limits.depth or self._bytes + size > limits.max_bytes):
                oldest_size, oldest = items.popleft()
                self._bytes -= oldest_size
                replaced.append(oldest)
            items.append((size, item))
            self._bytes += size
            self.filled = True
            while self._bytes > QUEUE_BYTES and len(self._queues) > 1:
                # An unverified one first, as it may replace no other; then the oldest but this one.
                found = next((each for each in self._queues if each[1]), None)
                found = found or next(each for each in self._queues if each != queue_key)
                ((oldest_size, oldest),) = self._queues.pop(found)
                self._bytes -= oldest_size
                replaced.append(oldest)
            if self._closed:
                replaced.append(self.take(0))
            dropped = self._dropped  # not that of a ``close`` which follows
        self._wakeup.set()
        for oldest in replaced:
            dropped(oldest)

    def take(self, timeout_s: float) -> T | None:
        """Remove and return an item of the key that has waited longest, a verified one first.

        Returns:
            The item; None after ``timeout_s`` without one, or if another thread took it.
        """
        if timeout_s > 0 and not self._queues:
            until_s = time.monotonic() + timeout_s
            while not self._queues and (left_s := until_s - time.monotonic()) > 0:
                self._wakeup.wait(left_s)
        with self._lock:
            if not self._queues:
                return None
            key, _ = next(iter(self._queues))
            queue_key = (key, False) if (key, False) in self._queues else (key, True)
            items = self._queues[queue_key]
            size, item = items.popleft()
            if not items:
                del self._queues[queue_key]
                self.filled = bool(self._queues)
            self._bytes -= size
            return item

    def close(self, dropped: Callable[[T], None]) -> None:
        """Pass the items that wait, and those that are still put, to a function instead."""
        left = []
        with self._lock:
            self._dropped, self._closed = dropped, True
            while (item := self.take(0)) is not None:
                left.append(item)
        for item in left:
            dropped(item)
        self._wakeup.set()


def wait_for_any(wakeup: Wakeup, buffers: Sequence[Buffer[Any]], timeout_s: float) -> None:
    """Wait until one of the buffers that share a wake-up has an item, or until the time-out.

    It may end sooner for no reason.
    """
    for buffer in buffers:
        if buffer.filled:
            return
    wakeup.wait(timeout_s)
