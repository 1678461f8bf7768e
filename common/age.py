"""How old a frame is, with no common clock.

Clocks of two machines differ, so ``now - stamp`` is no age. What it exceeds its recent minimum
by is: how much longer than the best frame of the last minute this one has been on its way.
"""

from __future__ import annotations

from collections import deque

WINDOW_S = 60.0
BUCKET_S = 1.0
SETTLE_S = 2.0


class AgeGauge:
    """Ages of one camera's frames over the best recently seen. Times come in as arguments.

    Args:
        max_age_ns: What counts as stale.
    """

    def __init__(self, max_age_ns: int) -> None:
        self.max_age_ns = max_age_ns
        self._minima: deque[tuple[float, int]] = deque()
        self._epoch: int | None = None
        self._last_stamp_ns: int | None = None
        self._unsettled: tuple[float, int, int] | None = None

    @property
    def offset_ns(self) -> int | None:
        """The least ``now - stamp`` of the window: time on the way plus the clocks' difference."""
        return min((offset for _, offset in self._minima), default=None)

    def arrive(self, epoch: int, stamp_ns: int, now_ns: int, at_s: float) -> None:
        """Take note of an arrival.

        Args:
            epoch: The frame's.
            stamp_ns: The frame's capture time by its camera's clock.
            now_ns: A clock here that nobody sets: the monotonic one.
            at_s: The same in seconds, for the window.
        """
        offset = now_ns - stamp_ns
        if epoch != self._epoch:
            self._epoch, self._last_stamp_ns = epoch, None
            self._unsettled = (at_s, offset, offset)
        elif self._last_stamp_ns is not None and stamp_ns < self._last_stamp_ns:
            # Frames of an epoch come in order: only a clock that was set back stamps earlier.
            self._minima.clear()
        self._last_stamp_ns = stamp_ns
        self._settle(offset, at_s)
        while self._minima and at_s - self._minima[0][0] > WINDOW_S:
            self._minima.popleft()
        if self._minima and at_s - self._minima[-1][0] < BUCKET_S:
            begun, best = self._minima[-1]
            self._minima[-1] = (begun, min(best, offset))
        else:
            self._minima.append((at_s, offset))

    def excess_ns(self, stamp_ns: int, now_ns: int) -> int:
        """Return how much older a frame is now than the best one was on its arrival."""
        best = self.offset_ns
        return 0 if best is None else now_ns - stamp_ns - best

    def is_stale(self, stamp_ns: int, now_ns: int) -> bool:
        """Tell whether a frame is too old to be handed out."""
        return self.excess_ns(stamp_ns, now_ns) > self.max_age_ns

    def _settle(self, offset: int, at_s: float) -> None:
        """Start afresh if a new epoch's frames are all equally "late": that is another clock.

        A queue that drains brings frames that are less and less late; only a camera that moved
        to a machine with another clock stays late by the same amount.
        """
        best = self.offset_ns
        if self._unsettled is None or best is None:
            return
        begun, low, high = self._unsettled
        low, high = min(low, offset), max(high, offset)
        self._unsettled = (begun, low, high)
        if low - best <= self.max_age_ns:
            self._unsettled = None
        elif at_s - begun > SETTLE_S:
            if high - low <= self.max_age_ns:
                self._minima.clear()
            self._unsettled = (at_s, offset, offset)
