"""Judges how far a source lags behind what it sees."""

from __future__ import annotations

from collections import deque
from typing import Final

WINDOW_S: Final = 1.0
SKIPPED_WINDOW_S: Final = 10.0

LAGS = (
    "pictures are {:.1f} s old when they come: the network or the camera delays them; use a "
    "smaller stream or a lower rate"
)
SKIPS = (
    "{} pictures of the last 10 s were skipped, since they waited for longer than max_lag: "
    "decoding is too slow, or the network paused; use a smaller stream, a lower rate or hwaccel"
)


class LagMonitor:
    """Takes the age of each picture when it comes, and the number of skipped ones.

    Written by the thread that reads the source, and read by another.
    """

    def __init__(self) -> None:
        self._ages: deque[tuple[float, float]] = deque()
        self._skips: deque[tuple[float, int]] = deque()

    def note(self, now_s: float, age_s: float, skipped: int) -> None:
        """Record a picture that came at a monotonic time."""
        self._ages.append((now_s, age_s))
        if skipped:
            self._skips.append((now_s, skipped))
        while self._ages[0][0] < now_s - WINDOW_S:
            self._ages.popleft()
        while self._skips and self._skips[0][0] < now_s - SKIPPED_WINDOW_S:
            self._skips.popleft()

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
        skips = [count for at_s, count in tuple(self._skips) if at_s >= now_s - SKIPPED_WINDOW_S]
        return SKIPS.format(sum(skips)) if skips else ""
