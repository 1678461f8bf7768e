"""Measures how late a frame is without a common clock.

The clocks of two machines differ, so ``now - stamp`` is no age. But the difference to its own
minimum of the last minute is how much longer a frame was delayed than the fastest one.
"""

from __future__ import annotations

from collections import deque

WINDOW_NS = 60 * 10**9
STEP_NS = 10**9
"""A frame within this time after a faster one is left out, so that few are kept."""


class StalenessGauge:
    """The least ``now - stamp`` of the last minute, ``now`` being monotonic; not locked."""

    def __init__(self) -> None:
        # Time and offset, ns: the least first, and each the least of those that came after it.
        self._minima: deque[tuple[int, int]] = deque()

    @property
    def offset_ns(self) -> int | None:
        """The least delay plus the difference of the clocks, ns; None if unknown."""
        return self._minima[0][1] if self._minima else None

    def lateness_ns(self, stamp_ns: int, now_ns: int) -> int:
        """Return how much later a frame is than the best of the last minute; 0 for the first."""
        while self._minima and now_ns - self._minima[0][0] > WINDOW_NS:
            self._minima.popleft()
        best = self.offset_ns
        return 0 if best is None else now_ns - stamp_ns - best

    def note(self, stamp_ns: int, now_ns: int) -> None:
        """Add a frame."""
        offset = now_ns - stamp_ns
        while self._minima and self._minima[-1][1] > offset:
            self._minima.pop()
        if not self._minima or now_ns - self._minima[-1][0] >= STEP_NS:
            self._minima.append((now_ns, offset))

    def restart(self) -> None:
        """Forget all frames: those that follow have stamps of another clock."""
        self._minima.clear()
