"""Tells a frozen source: one that delivers exactly the same picture again and again."""

from __future__ import annotations

import numpy as np

from services.camera.sources.base import Picture


class RepeatWatch:
    """Compares each picture with the one before it.

    Sensor noise makes every picture of a real scene differ; exact equality means that the
    device or server repeats itself.

    Args:
        frozen_after_s: So long without a new picture is frozen.
    """

    def __init__(self, frozen_after_s: float) -> None:
        self.frozen_after_s = frozen_after_s
        self._last: Picture | None = None
        self._changed_s = 0.0

    def repeats(self, picture: Picture, now_s: float) -> bool:
        """Tell whether a picture equals the one before it."""
        last, self._last = self._last, picture
        if last is not None and _equal(last, picture):
            return True
        self._changed_s = now_s
        return False

    def frozen(self, now_s: float) -> bool:
        """Tell whether the source has repeated itself for too long."""
        return self._last is not None and now_s - self._changed_s >= self.frozen_after_s


def _equal(one: Picture, other: Picture) -> bool:
    if one.jpeg is not None and other.jpeg is not None:
        return one.jpeg == other.jpeg
    if one.pixels is None or other.pixels is None or one.pixels.shape != other.pixels.shape:
        return False
    row = one.pixels.shape[0] // 2
    if not np.array_equal(one.pixels[row], other.pixels[row]):
        return False  # nearly always decided by one row
    return np.array_equal(one.pixels, other.pixels)
