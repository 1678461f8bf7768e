"""Health of a node: rate, latencies, level, and complaints that do not flood the log."""

from __future__ import annotations

import logging
import math
import threading
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from itertools import accumulate

from common.errors import PayloadError
from common.messages import Histogram, Latency

OK, WARN, ERROR, STALE = 0, 1, 2, 3
WINDOW_S = 5.0
QUIET_S = 5.0
BOUNDS_MS = tuple(
    map(float, (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 1000, 2000, 5000))
)
"""Upper bounds of the latency histogram: finest where frame times and budgets are."""


class Pace:
    """Rate and latency over the last seconds, and all latencies since the start.

    Times come in as arguments.
    """

    def __init__(self, window_s: float = WINDOW_S) -> None:
        self._window_s = window_s
        self._done: deque[tuple[float, float]] = deque()
        self._buckets = [0] * (len(BOUNDS_MS) + 1)
        self._sum_ms = 0.0
        self._lock = threading.Lock()

    def note(self, at_s: float, latency_ms: float) -> None:
        """Take note of one frame done at a monotonic time, so long after its capture."""
        # The clock of a camera may be ahead. A sum that falls would look like a restart.
        counted_ms = max(0.0, latency_ms)
        with self._lock:
            self._done.append((at_s, latency_ms))
            self._forget(at_s)
            self._buckets[bisect_left(BOUNDS_MS, counted_ms)] += 1
            self._sum_ms += counted_ms

    def rate_hz(self, at_s: float) -> float:
        """Return frames per second over the window, or since the first if that is shorter."""
        with self._lock:
            self._forget(at_s)
            if len(self._done) < 2:
                return 0.0
            periods = len(self._done) - 1
            span_s = self._done[-1][0] - self._done[0][0]
            # The time since the last one counts only once the next is overdue: else the rate
            # of a steady stream would come out too low.
            overdue_s = max(0.0, at_s - self._done[-1][0] - span_s / periods)
            return periods / max(span_s + overdue_s, 1e-3)

    def latency(self, at_s: float) -> Latency:
        """Return the percentiles of the window (nearest rank), nil when it is empty."""
        with self._lock:
            self._forget(at_s)
            ordered = sorted(latency for _, latency in self._done)
        if not ordered:
            return Latency(p50=None, p99=None)
        p50, p99 = (ordered[math.ceil(len(ordered) * n / 100) - 1] for n in (50, 99))
        return Latency(p50=p50, p99=p99)

    def histogram(self) -> Histogram:
        """Return all latencies since the start; a negative one counts as 0."""
        with self._lock:
            counts, sum_ms = tuple(accumulate(self._buckets)), self._sum_ms
        return Histogram(bounds=BOUNDS_MS, counts=counts, sum=sum_ms)

    def _forget(self, at_s: float) -> None:
        while self._done and at_s - self._done[0][0] > self._window_s:
            self._done.popleft()


@dataclass(slots=True)
class _Burst:
    last_s: float
    suppressed: int = 0


class Complaints:
    """Logs the first drop of a burst, and how many followed when the burst is over.

    Args:
        log: Where to.
    """

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._bursts: dict[str, _Burst] = {}
        self._lock = threading.Lock()

    def note(self, error: PayloadError, at_s: float) -> None:
        """Log a drop if it is the first of its reason for a while; else count it."""
        with self._lock:
            burst = self._bursts.get(error.reason)
            if burst is not None:
                burst.last_s = at_s
                burst.suppressed += 1
                return
            self._bursts[error.reason] = _Burst(at_s)
        self._log.warning("dropped a sample, %s", error)

    def settle(self, at_s: float) -> None:
        """Sum up the bursts that have been quiet long enough."""
        with self._lock:
            over = [
                (reason, burst.suppressed)
                for reason, burst in self._bursts.items()
                if at_s - burst.last_s > QUIET_S
            ]
            for reason, _ in over:
                del self._bursts[reason]
        for reason, suppressed in over:
            if suppressed:
                self._log.warning("dropped %d more samples as %s", suppressed, reason)

    def current(self) -> list[str]:
        """Return the reasons of the bursts that are not over."""
        with self._lock:
            return sorted(self._bursts)
