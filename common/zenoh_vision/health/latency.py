"""Rate and latency of the frames that a node finished."""

from __future__ import annotations

import math
import threading
from bisect import bisect_left
from collections import deque
from itertools import accumulate

from zenoh_vision.messages import Histogram, Latency

WINDOW_S = 5.0
LEAST_S = 1.0
"""Shortest time over which a rate is computed. The first frame takes longer than those after it, as
what it needs is loaded and allocated, so the first intervals are too short."""

MOST = 50_000
"""Most items that are kept until the next report, which forgets those before the window."""

BOUNDS_MS = tuple(
    map(float, (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 1000, 2000, 5000))
)
"""Upper bounds of the latency histogram, milliseconds: finest around usual frame times."""


class LatencyMonitor:
    """Rate and latency over the last seconds, and all latencies since the start.

    Times come in as arguments.
    """

    def __init__(self, window_s: float = WINDOW_S) -> None:
        self._window_s = window_s
        self._done: deque[tuple[float, float | None]] = deque(maxlen=MOST)
        self._buckets = [0] * (len(BOUNDS_MS) + 1)
        self._sum_ms = 0.0
        self._lock = threading.Lock()

    def note(self, at_s: float, latency_ms: float | None) -> None:
        """Add an item that was finished at a monotonic time, with its latency if known."""
        with self._lock:
            self._done.append((at_s, latency_ms))
            if latency_ms is None:
                return
            # The clock of a camera may be ahead. A sum that falls would look like a restart.
            counted_ms = max(0.0, latency_ms)
            self._buckets[bisect_left(BOUNDS_MS, counted_ms)] += 1
            self._sum_ms += counted_ms

    def rate_hz(self, at_s: float) -> float:
        """Return items per second over the window, or since the first if that is shorter.

        It is 0 until ``LEAST_S`` after the first.
        """
        with self._lock:
            self._forget(at_s)
            if len(self._done) < 2 or at_s - self._done[0][0] < LEAST_S:
                return 0.0
            periods = len(self._done) - 1
            span_s = self._done[-1][0] - self._done[0][0]
            # The time since the last item counts only when the next is overdue. Otherwise the rate
            # of a steady stream would be too low.
            overdue_s = max(0.0, at_s - self._done[-1][0] - span_s / periods)
            return periods / max(span_s + overdue_s, 1e-3)

    def percentiles(self, at_s: float) -> Latency:
        """Return the percentiles of the window (nearest rank), nil without any latency."""
        with self._lock:
            self._forget(at_s)
            ordered = sorted([latency for _, latency in self._done if latency is not None])
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
