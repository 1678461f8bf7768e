"""Pictures of 16 bits: depth in millimetres or metres, and the 8 bits that show or process them.

A value of 0 is no reading. It stays 0 in 8 bits, where readings are 1 to 255, so that a hole in a
depth image is not taken for something near.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

MAX_VALUE: Final = 65535
RATIO: Final = 257  # 65535 / 255
MM_PER_M: Final = 1000.0

PERCENTILES: Final = (1, 99)
"""Percentiles of the readings at which the automatic range begins and ends, by nearest rank."""

MAX_OUTSIDE: Final = 0.05
LEAST_USED: Final = 0.5
"""An automatic range is kept until more than 5 % of the readings are outside, or their percentiles
span less than half of it: each change of it changes every pixel, which looks like motion."""

SAMPLES: Final = 100_000
"""About how many pixels are sampled, in even steps over rows and columns."""


@dataclass(frozen=True, slots=True)
class ValueRange:
    """The values of 16 bits that become 1 and 255; those outside are clipped.

    Attributes:
        low: 0 to 65534.
        high: Above ``low``, up to 65535.
    """

    low: int
    high: int


WHOLE: Final = ValueRange(0, MAX_VALUE)


def eight_bits(pixels: NDArray[Any], values: ValueRange | None = None) -> NDArray[np.uint8]:
    """Return 16-bit pixels of any shape in 8 bits.

    Args:
        pixels: uint16; not modified.
        values: 0 stays 0, and a value v of at least 1 becomes 1 + 254 (v - low) / (high - low),
            rounded, after it was clipped to the range. None scales by 255 / 65535, rounded, as
            cv_bridge does.
    """
    if values is None:
        return np.asarray(cv2.convertScaleAbs(pixels, alpha=1 / RATIO), np.uint8)
    return np.asarray(cv2.LUT(pixels, _table(values)), np.uint8)


def millimetres(metres: NDArray[Any]) -> NDArray[np.uint16]:
    """Return depth in metres (``32FC1``) as millimetres (``16UC1``), rounded.

    NaN, infinity, zero and negative values are no reading, 0. Over 65.535 m it is 65535.
    """
    with np.errstate(over="ignore"):
        values = metres.astype(np.float32) * np.float32(MM_PER_M)
    np.rint(values, out=values)
    values[~(np.isfinite(metres) & (metres > 0))] = 0
    return np.asarray(np.minimum(values, MAX_VALUE, out=values), np.uint16)


def metres(millimetres: NDArray[np.uint16]) -> NDArray[np.float32]:
    """Return depth in millimetres (``16UC1``) as metres (``32FC1``); no reading, 0, becomes NaN."""
    found = millimetres.astype(np.float32) / np.float32(MM_PER_M)
    found[millimetres == 0] = np.nan
    return found


class RangeFinder:
    """Finds the range of a stream's values: as set, else automatically; safe between threads.

    Attributes:
        limits: The lowest and the highest value, each None for automatic.
    """

    def __init__(self, limits: tuple[int | None, int | None] = (None, None)) -> None:
        self.limits = limits
        self._automatic: ValueRange | None = None
        self._lock = threading.Lock()

    def range_of(self, pixels: NDArray[np.uint16]) -> ValueRange:
        """Return the range for the next picture of the stream, (height, width) uint16."""
        low, high = self.limits
        if low is None or high is None:
            automatic = self._find(pixels)
            low = automatic.low if low is None else low
            high = automatic.high if high is None else high
        low = min(low, MAX_VALUE - 1)
        return ValueRange(low, max(high, low + 1))

    def _find(self, pixels: NDArray[np.uint16]) -> ValueRange:
        step = max(1, round((pixels.size / SAMPLES) ** 0.5))
        readings = pixels[::step, ::step]
        readings = np.sort(readings[readings > 0], kind="stable")  # radix sort
        with self._lock:
            known = self._automatic
            if readings.size and (known is None or not _fits(known, readings)):
                known = self._automatic = ValueRange(*_percentiles(readings))
            return known or WHOLE


def _percentiles(ordered: NDArray[np.uint16]) -> tuple[int, int]:
    low, high = (ordered[-(-len(ordered) * percent // 100) - 1] for percent in PERCENTILES)
    return int(low), int(high)


def _fits(values: ValueRange, ordered: NDArray[np.uint16]) -> bool:
    below = np.searchsorted(ordered, values.low, "left")
    above = len(ordered) - np.searchsorted(ordered, values.high, "right")
    low, high = _percentiles(ordered)
    is_used = high - low >= LEAST_USED * (values.high - values.low)
    return bool(below + above <= MAX_OUTSIDE * len(ordered)) and is_used


@lru_cache(maxsize=16)
def _table(values: ValueRange) -> NDArray[np.uint8]:
    steps = np.clip(np.arange(MAX_VALUE + 1), values.low, values.high) - values.low
    table = 1 + np.rint(254 * steps / (values.high - values.low))
    table[0] = 0
    return table.astype(np.uint8)
