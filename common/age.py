"""How old a frame is, with no common clock.

Clocks of two machines differ, so ``now - stamp`` is no age. What it exceeds its recent minimum
by is: how much longer than the best frame of the last minute this one has been on its way.
"""

from __future__ import annotations

import threading
from collections import deque

WINDOW_S = 60.0
BUCKET_S = 1.0
SETTLE_S = 2.0


class AgeGauge:
    """Ages of one camera's frames over the best recently seen; safe to use from two threads.

    Only frames of the accepted epoch set the measure, so that broken frames under a made-up
    identity cannot make the good ones look late. ``now_ns`` is a clock here that nobody sets:
    the monotonic one. Times come in as arguments.

    Args:
        max_age_ns: What counts as stale.
    """

    def __init__(self, max_age_ns: int) -> None:
        self.max_age_ns = max_age_ns
        self._minima: deque[tuple[int, int]] = deque()  # when, least offset; both ns
        self._epoch: int | None = None
        self._last_stamp_ns = 0
        self._challenger: _Challenger | None = None
        self._lock = threading.Lock()

    @property
    def offset_ns(self) -> int | None:
        """The least ``now - stamp`` of the window: time on the way plus the clocks' difference."""
        with self._lock:
            return self._best()

    def arrive(self, epoch: int, stamp_ns: int, now_ns: int) -> None:
        """Take note of an arrival that may never be accepted."""
        with self._lock:
            offset = now_ns - stamp_ns
            if epoch == self._epoch:
                return
            if self._challenger is None or self._challenger.epoch != epoch:
                self._challenger = _Challenger(epoch, now_ns, offset)
            else:
                self._challenger.note(offset)

    def is_stale(self, epoch: int, stamp_ns: int, now_ns: int) -> bool:
        """Tell whether a frame that is next in order is too old to be handed out."""
        with self._lock:
            return self._late(stamp_ns, now_ns) and not self._another_clock(epoch, stamp_ns, now_ns)

    def accept(self, epoch: int, stamp_ns: int, arrived_ns: int) -> None:
        """Take note that a frame is about to be seen: it is part of the measure from now on."""
        with self._lock:
            if self._late(stamp_ns, arrived_ns):
                self._minima.clear()  # its clock is another one: the old measure does not apply
            if epoch != self._epoch:
                self._epoch, self._challenger = epoch, None
            self._last_stamp_ns = stamp_ns
            self._note(arrived_ns - stamp_ns, arrived_ns)

    def _another_clock(self, epoch: int, stamp_ns: int, now_ns: int) -> bool:
        """Tell a clock that was set back, or another machine's, from frames that are late."""
        if epoch == self._epoch:
            # Frames of an epoch come in order: only a clock that was set back stamps earlier.
            return stamp_ns < self._last_stamp_ns
        # A queue that drains brings frames that are less and less late; those of a camera that
        # moved to a machine with another clock stay late by the same amount.
        challenger = self._challenger
        return (
            challenger is not None
            and challenger.epoch == epoch
            and now_ns - challenger.begun_ns > SETTLE_S * 1e9
            and challenger.spread_ns <= self.max_age_ns
        )

    def _best(self) -> int | None:
        return min((offset for _, offset in self._minima), default=None)

    def _late(self, stamp_ns: int, now_ns: int) -> bool:
        while self._minima and now_ns - self._minima[0][0] > WINDOW_S * 1e9:
            self._minima.popleft()
        best = self._best()
        return best is not None and now_ns - stamp_ns - best > self.max_age_ns

    def _note(self, offset: int, now_ns: int) -> None:
        if self._minima and now_ns - self._minima[-1][0] < BUCKET_S * 1e9:
            begun, best = self._minima[-1]
            self._minima[-1] = (begun, min(best, offset))
        else:
            self._minima.append((now_ns, offset))


class _Challenger:
    """How late the frames of an epoch that is not accepted yet have been."""

    def __init__(self, epoch: int, begun_ns: int, offset: int) -> None:
        self.epoch = epoch
        self.begun_ns = begun_ns
        self._low = self._high = offset

    @property
    def spread_ns(self) -> int:
        return self._high - self._low

    def note(self, offset: int) -> None:
        self._low, self._high = min(self._low, offset), max(self._high, offset)
