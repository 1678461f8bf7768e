"""Adds sensor noise to a frame, at the cost of two additions."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

SPAN = 128  # windows in each direction
TILE = 512  # period of the sheets, pixels; invisible in noise


class SensorNoise:
    """Gaussian noise, cut from one large sheet at a position that differs from frame to frame.

    Generating new noise would take ten times as long as the rest of the frame. The positions
    follow a seeded order without repetition, so that two frames with the same noise are at least
    16384 frames apart.
    ``sigma`` is the standard deviation in grey levels, 0 for none.
    """

    def __init__(self, width: int, height: int, sigma: float, seed: tuple[int, ...]) -> None:
        self._size = (width, height)
        self._sigma = sigma
        rng = np.random.default_rng(seed)
        self._order = rng.permutation(SPAN * SPAN)
        tile = np.rint(rng.standard_normal((TILE, TILE, 3), np.float32) * np.float32(sigma))
        rows, columns = height + SPAN, width + SPAN
        repeats = (-(-rows // TILE), -(-columns // TILE), 1)
        # Saturating 8-bit arithmetic is fastest, but has no sign, hence two sheets.
        self._brighter, self._darker = (
            np.ascontiguousarray(np.tile(part.astype(np.uint8), repeats)[:rows, :columns])
            for part in (np.clip(tile, 0, 255), np.clip(-tile, 0, 255))
        )

    def add(self, k: int, bgr: NDArray[np.uint8]) -> None:
        """Add the noise of frame k to a (height, width, 3) uint8 picture, in place."""
        if self._sigma:
            window = self._window(k)
            cv2.add(bgr, self._brighter[window], dst=bgr)
            cv2.subtract(bgr, self._darker[window], dst=bgr)

    def signed(self, k: int) -> NDArray[np.int16]:
        """Return the noise of frame k in one channel, (height, width) int16, grey levels."""
        window = (*self._window(k), 0)
        brighter, darker = self._brighter[window], self._darker[window]
        return np.asarray(np.subtract(brighter, darker, dtype=np.int16))

    def _window(self, k: int) -> tuple[slice, slice]:
        width, height = self._size
        top, left = divmod(int(self._order[k % (SPAN * SPAN)]), SPAN)
        return np.s_[top : top + height, left : left + width]
