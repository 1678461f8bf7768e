"""Sensor noise that costs two additions a frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

SPAN = 128  # windows in each direction
WINDOWS = SPAN * SPAN
TILE = 512  # the sheet repeats after so many pixels, which nobody sees in noise


class SensorNoise:
    """Gaussian noise, cut from one large sheet at a place that differs from frame to frame.

    Drawing fresh noise would cost ten times the rest of the frame. The places come in a seeded
    order without repetition, so no two frames less than 16384 apart have the same noise.

    Args:
        width: Pixels.
        height: Pixels.
        sigma: Standard deviation, grey levels; 0 for none.
        seed: Of the sheet and of the order, any sequence of integers.
    """

    def __init__(self, width: int, height: int, sigma: float, seed: tuple[int, ...]) -> None:
        self._size = (width, height)
        self._sigma = sigma
        rng = np.random.default_rng(seed)
        self._order = rng.permutation(WINDOWS)
        tile = np.rint(rng.standard_normal((TILE, TILE, 3), np.float32) * np.float32(sigma))
        # Saturating 8-bit arithmetic is the fastest there is, but has no sign: two sheets.
        self._brighter = _sheet(np.clip(tile, 0, 255).astype(np.uint8), width, height)
        self._darker = _sheet(np.clip(-tile, 0, 255).astype(np.uint8), width, height)

    def add(self, k: int, bgr: NDArray[np.uint8]) -> None:
        """Add the noise of frame k to a (height, width, 3) uint8 picture, in place."""
        if not self._sigma:
            return
        width, height = self._size
        top, left = divmod(int(self._order[k % WINDOWS]), SPAN)
        window = np.s_[top : top + height, left : left + width]
        cv2.add(bgr, self._brighter[window], dst=bgr)
        cv2.subtract(bgr, self._darker[window], dst=bgr)


def _sheet(tile: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Return a tile repeated over a picture's size and the span of the windows."""
    rows, columns = height + SPAN, width + SPAN
    repeated = np.tile(tile, (-(-rows // TILE), -(-columns // TILE), 1))
    return np.ascontiguousarray(repeated[:rows, :columns])
