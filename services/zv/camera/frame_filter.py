"""Selects the pictures of a source that are passed on: limits the rate, and drops repeats."""

from __future__ import annotations

from zenoh_vision.image.stored import are_equal
from zv.camera.sources.base import Picture

EARLY = 0.25
"""Share of a period that a picture may be early; without it, jitter could halve the rate."""


class FrameFilter:
    """Limits the rate of a live source, and detects a frozen one.

    Due to sensor noise, all pictures of a real scene differ: equal pictures mean that the device
    or server repeats itself. The limits may differ from one call to the next.
    """

    def __init__(self) -> None:
        self._rate_hz: float | None = None
        self._next_s: float | None = None
        self._last: Picture | None = None
        self._changed_s = 0.0
        self._frozen_after_s = 0.0

    def allow(self, rate_hz: float | None, now_s: float) -> bool:
        """Tell whether a picture that arrives now is passed on at this rate; None for no limit."""
        if rate_hz is None or rate_hz != self._rate_hz:
            self._rate_hz, self._next_s = rate_hz, None
        if rate_hz is None:
            return True
        period_s = 1.0 / rate_hz
        due_s = now_s if self._next_s is None else self._next_s
        if now_s < due_s - EARLY * period_s:
            return False
        self._next_s = max(due_s + period_s, now_s)
        return True

    def is_repeat(self, picture: Picture, frozen_after_s: float, now_s: float) -> bool:
        """Tell whether a picture equals the one before it.

        Args:
            picture: The picture that arrives now.
            frozen_after_s: Seconds of repeats after which the source is ``frozen``; 0 for a
                source that may repeat its pictures, which are then not compared.
            now_s: Monotonic clock, seconds.
        """
        self._frozen_after_s = frozen_after_s
        last, self._last = self._last, picture if frozen_after_s else None
        if frozen_after_s and last is not None and _equal(last, picture):
            return True
        self._changed_s = now_s
        return False

    def frozen(self, now_s: float) -> bool:
        """Tell whether only repeats have arrived for too long."""
        return self._last is not None and now_s - self._changed_s >= self._frozen_after_s


def _equal(one: Picture, other: Picture) -> bool:
    if one.jpeg is not None and other.jpeg is not None:
        return one.jpeg == other.jpeg
    if one.stored is not None and other.stored is not None:
        return one.stored.equals(other.stored)
    if one.pixels is None or other.pixels is None:
        return False
    return are_equal(one.pixels, other.pixels)
