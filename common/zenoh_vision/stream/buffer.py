"""Buffers between the thread that receives items and the one that takes them."""

from __future__ import annotations

import math
import threading
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
        depth: Most items that wait, per key or in all.
        per_key: Whether ``depth`` applies to each key.
        reason: Items that a newer one replaced are counted as ``dropped.{reason}``.
        max_bytes: Most bytes that wait, counted as ``depth`` is; the newest item always may.
    """

    depth: int
    per_key: bool
    reason: str
    max_bytes: float = math.inf


latest = Buffering(1, per_key=True, reason="overwritten")
"""The newest item of each key; a newer one replaces it (``dropped.overwritten``)."""


QUEUE_BYTES = 256 << 20


def queue(depth: int, max_bytes: int = QUEUE_BYTES) -> Buffering:
    """Return a queue of at least 1 item; when full, it drops the oldest (``dropped.overflow``).

    It is full when ``depth`` items wait, or payloads of ``max_bytes`` in all.
    """
    if depth < 1:
        raise ValueError(f"a queue of {depth} items; at least 1 is needed")
    return Buffering(depth, per_key=False, reason="overflow", max_bytes=max_bytes)


class _Lane(Generic[T]):
    """A queue of items, oldest first, each with its position and its size."""

    def __init__(self) -> None:
        self.items: deque[tuple[int, int, T]] = deque()
        self.size = 0

    def append(self, turn: int, size: int, item: T) -> None:
        self.items.append((turn, size, item))
        self.size += size

    def popleft(self) -> tuple[int, T]:
        turn, size, item = self.items.popleft()
        self.size -= size
        return turn, item


class Buffer(Generic[T]):
    """Items of one input, oldest first; safe between threads.

    Items of an unverified epoch wait in a separate queue, so that they do not replace those of the
    current epoch; verified items are taken first.

    Args:
        buffering: How many items wait.
        dropped: Called with each item that a newer one replaced.
        filled: Shared by the buffers that one consumer waits for together.
    """

    def __init__(
        self,
        buffering: Buffering,
        dropped: Callable[[T], None],
        filled: Wakeup | None = None,
    ) -> None:
        self._buffering = buffering
        self._dropped = dropped
        self._filled = filled or Wakeup()
        self._lock = threading.Lock()
        self._lanes: dict[tuple[str, bool], _Lane[T]] = {}
        self._number = 0

    def put(self, item: T, key: str = "", *, unverified: bool = False, size: int = 0) -> None:
        """Add an item of ``size`` bytes; drop the oldest of its queue while that is full."""
        per_key = self._buffering.per_key
        lane_key = (key, unverified) if per_key else ("", False)  # a queue keeps the order
        with self._lock:
            self._number += 1
            lane = self._lanes.setdefault(lane_key, _Lane())
            replaced = []
            while lane.items and (
                len(lane.items) == self._buffering.depth
                or lane.size + size > self._buffering.max_bytes
            ):
                replaced.append(lane.popleft())
            # A newer item takes the position of the one that it replaces.
            turn = replaced[0][0] if replaced and per_key else self._number
            lane.append(turn, size, item)
        self._filled.set()
        for _, oldest in replaced:
            self._dropped(oldest)

    @property
    def filled(self) -> bool:
        """Whether an item waits."""
        return bool(self._lanes)

    def take(self, timeout_s: float) -> T | None:
        """Return an item of the key that waits longest, a verified one first.

        None if none came, or another thread took it.
        """
        if not self._lanes and not self._filled.wait_for(lambda: self._lanes, timeout_s):
            return None
        with self._lock:
            if not self._lanes:
                return None  # another thread took it
            key = min(self._lanes, key=lambda lane: self._lanes[lane].items[0][0])[0]
            lane_key = (key, False) if (key, False) in self._lanes else (key, True)
            lane = self._lanes[lane_key]
            _, item = lane.popleft()
            if not lane.items:
                del self._lanes[lane_key]
            return item


def wait_for_any(filled: Wakeup, buffers: Sequence[Buffer[Any]], timeout_s: float) -> None:
    """Wait until one of the buffers that share a wake-up has an item, or the time-out."""
    filled.wait_for(lambda: any(buffer.filled for buffer in buffers), timeout_s)
