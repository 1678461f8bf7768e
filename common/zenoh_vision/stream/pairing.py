"""Pairs the items of two streams by the stamps in their headers. Uses neither network nor clock.

The rules are those of the approximate time policy of ROS's message_filters, for two streams:

- Two items are a pair if their stamps differ by no more than the tolerance.
- Each item is in one pair at most, and pairs come in the order of their stamps.
- An item waits until its partner arrives, until none can follow, since the other stream is past it,
  or until the time limit. If a stream ends, the items of the other therefore do not wait forever.
- If the stream of the pair's earlier item has a next item that is nearer to the later one, the
  earlier item stays without a partner. With a tolerance below half of the time between two frames,
  that cannot happen.

Stamps are compared directly, so cameras on two machines need synchronized clocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")

Side = int
"""0 is the first stream, 1 the second."""

WAITING_BYTES = 256 << 20


@dataclass(frozen=True, slots=True)
class _Waiting(Generic[T]):
    stamp_ns: int
    arrived_ns: int
    item: T
    size: int


class PairBuffer(Generic[T]):
    """Items of two streams that wait for their partners.

    Args:
        tolerance_ns: By how much the stamps of a pair may differ at most.
        wait_ns: How long an item waits for its partner.
        depth: Most items of a stream that wait, of 256 MiB in all; if there are more, the oldest
            are yielded alone.
    """

    def __init__(self, tolerance_ns: int, wait_ns: int, depth: int) -> None:
        self._tolerance_ns = tolerance_ns
        self._wait_ns = wait_ns
        self._depth = depth
        self._queues: tuple[deque[_Waiting[T]], deque[_Waiting[T]]] = (deque(), deque())
        self._alone: deque[tuple[Side, T]] = deque()

    def put(self, side: Side, stamp_ns: int, item: T, now_ns: int, size: int = 0) -> None:
        """Add an item of ``size`` bytes that arrived now, by a monotonic clock."""
        queue = self._queues[side]
        if queue and stamp_ns < queue[-1].stamp_ns:
            # The clock of the stream was set back: no partners can follow for the items that wait.
            self._alone.extend((side, each.item) for each in queue)
            queue.clear()
        queue.append(_Waiting(stamp_ns, now_ns, item, size))
        while len(queue) > 1 and (
            len(queue) > self._depth or sum(each.size for each in queue) > WAITING_BYTES
        ):
            self._leave(side)

    def take(self, now_ns: int) -> Iterator[tuple[T | None, T | None]]:
        """Yield the complete pairs, and the items without a partner, with None beside them."""
        while True:
            while self._alone:
                side, item = self._alone.popleft()
                yield (item, None) if side == 0 else (None, item)
            pair = self._next_pair()
            if pair is not None:
                yield pair
            elif not self._alone and not self._leave_overdue(now_ns):
                return

    def clear(self) -> list[T]:
        """Return all items that wait, and forget them."""
        found = [item for _, item in self._alone]
        found += [each.item for queue in self._queues for each in queue]
        self._alone.clear()
        for queue in self._queues:
            queue.clear()
        return found

    def _next_pair(self) -> tuple[T, T] | None:
        """Return the oldest pair; None if there is none, or if an item was set aside instead.

        An item is set aside when it cannot have a partner any more.
        """
        first, second = self._queues
        if not first or not second:
            return None
        earlier: Side = 0 if first[0].stamp_ns <= second[0].stamp_ns else 1
        queue, partner = self._queues[earlier], self._queues[1 - earlier][0]
        apart_ns = partner.stamp_ns - queue[0].stamp_ns
        nearer = len(queue) > 1 and abs(partner.stamp_ns - queue[1].stamp_ns) < apart_ns
        if apart_ns > self._tolerance_ns or nearer:
            self._leave(earlier)
            return None
        return first.popleft().item, second.popleft().item

    def _leave_overdue(self, now_ns: int) -> bool:
        """Give up an item that has waited too long; return whether there was one."""
        for side, queue in enumerate(self._queues):
            if queue and now_ns - queue[0].arrived_ns >= self._wait_ns:
                self._leave(side)
                return True
        return False

    def _leave(self, side: Side) -> None:
        self._alone.append((side, self._queues[side].popleft().item))
