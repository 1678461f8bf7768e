"""Judges how far a source lags behind what it sees, and what the network loses of it."""

from __future__ import annotations

from collections import deque
from typing import Final

WINDOW_S: Final = 1.0
COUNTED_S: Final = 10.0

LAGS = (
    "pictures are {:.1f} s old when they come: the network or the camera delays them; use a "
    "smaller stream or a lower rate"
)
SKIPS = (
    "{} pictures of the last 10 s were skipped, since they waited for longer than max_lag: "
    "decoding is too slow, or the network paused; use a smaller stream, a lower rate or hwaccel"
)
LOST = (
    "{} packets of the last 10 s were lost in the network; pictures that they damage are left out, "
    "up to the next key picture: use rtsp_transport tcp, a better link or a smaller stream"
)


class RecentCount:
    """How often something happened in the last ``COUNTED_S``.

    Written by one thread, and read by another.
    """

    def __init__(self) -> None:
        self._counts: deque[tuple[float, int]] = deque()

    def add(self, now_s: float, count: int) -> None:
        """Record that it happened so often, at a monotonic time."""
        self._counts.append((now_s, count))
        while self._counts[0][0] < now_s - COUNTED_S:
            self._counts.popleft()

    def total(self, now_s: float) -> int:
        """Return how often it happened."""
        return sum(n for at_s, n in tuple(self._counts) if at_s >= now_s - COUNTED_S)


class LagMonitor:
    """Takes the age of each picture when it comes, and what was skipped and lost before it.

    Written by the thread that reads the source, and read by another.
    """

    def __init__(self) -> None:
        self._ages: deque[tuple[float, float]] = deque()
        self._skipped = RecentCount()
        self._packets_lost = RecentCount()

    def note(self, now_s: float, age_s: float, skipped: int, packets_lost: int = 0) -> None:
        """Record a picture that came at a monotonic time."""
        self._ages.append((now_s, age_s))
        if skipped:
            self._skipped.add(now_s, skipped)
        if packets_lost:
            self._packets_lost.add(now_s, packets_lost)
        while self._ages[0][0] < now_s - WINDOW_S:
            self._ages.popleft()

    def newest_ms(self, now_s: float) -> float | None:
        """Return the age of the newest picture when it came; None if none came in the window."""
        newest = next(reversed(tuple(self._ages)), None)
        if newest is None or newest[0] < now_s - WINDOW_S:
            return None
        return 1000 * newest[1]

    def words(self, now_s: float, max_lag_s: float) -> str:
        """Return what is the matter; empty if nothing is, or if there is no limit.

        A source lags if even the youngest picture of the last second was too old.
        """
        if not max_lag_s:
            return ""
        ages = [age_s for at_s, age_s in tuple(self._ages) if at_s >= now_s - WINDOW_S]
        if ages and min(ages) > max_lag_s:
            return LAGS.format(min(ages))
        skipped = self._skipped.total(now_s)
        return SKIPS.format(skipped) if skipped else ""

    def loss_words(self, now_s: float) -> str:
        """Return what the network loses; empty if nothing."""
        lost = self._packets_lost.total(now_s)
        return LOST.format(lost) if lost else ""
