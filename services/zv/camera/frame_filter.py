"""Selects the pictures of a source that are passed on: limits the rate, and finds repeats."""

from __future__ import annotations

from zenoh_vision.image.picture import Picture

EARLY = 0.25
"""Share of a period that a picture may be early; without it, jitter could halve the rate."""


class FrameFilter:
    """Limits the rate of a live source, and tells how long its picture has not changed.

    Sensor noise makes all pictures of a real scene differ, but a screen, a test picture, a covered
    lens or a video codec at night delivers equal ones: they are no fault of the source.
    """

    def __init__(self) -> None:
        self._rate_hz: float | None = None
        self._next_s: float | None = None
        self._last: Picture | None = None
        self._changed_s = self._repeated_s = 0.0

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

    def is_repeat(self, picture: Picture, now_s: float) -> bool:
        """Tell whether a picture, which arrives now, equals the one before it."""
        last, self._last = self._last, picture
        self._repeated_s = now_s
        if last is not None and picture.equals(last):
            return True
        self._changed_s = now_s
        return False

    @property
    def still_s(self) -> float:
        """How long equal pictures have come, seconds; 0 without a repeat.

        A slow source is not still while it waits for its next picture.
        """
        return self._repeated_s - self._changed_s
