"""Measures how much a page's link carries, while the link limits the pictures that are sent."""

from __future__ import annotations

WINDOW_S = 2.0
BUSY = 0.7
"""The link is the limit if sending has waited for it for this share of the time."""


class LinkGauge:
    """Adds up the bytes sent to a page and the time that sending took; times are monotonic."""

    def __init__(self, now_s: float) -> None:
        self._restart(now_s)

    def add(self, size: int, begun_s: float, done_s: float) -> int | None:
        """Count bytes whose sending took from ``begun_s`` to ``done_s``.

        Returns:
            About every 2 s, if the link is the limit: its throughput, bits per second; else None.
        """
        self._bytes += size
        self._busy_s += done_s - begun_s
        passed_s = done_s - self._since_s
        if passed_s < WINDOW_S:
            return None
        limits = self._busy_s > BUSY * passed_s
        carried = round(8 * self._bytes / passed_s)
        self._restart(done_s)
        return carried if limits else None

    def _restart(self, now_s: float) -> None:
        self._since_s, self._busy_s, self._bytes = now_s, 0.0, 0
