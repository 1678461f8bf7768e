"""Reads the number that a picture of the synthetic camera shows (``frame_code``)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from zv.camera.synthetic.frame_code import ACROSS, BITS, BLOCKS, DOWN, coded

DOUBT = 32  # grey levels on either side of the middle that are neither 0 nor 1


def read_number(bgr: NDArray[np.uint8]) -> int | None:
    """Return the number in a picture, or None if it has none or cannot be read with certainty.

    Args:
        bgr: (height, width, 3) uint8 BGR, of any size, at least 40 pixels wide and 30 high.
    """
    height, width = bgr.shape[:2]
    if width < 2 * ACROSS or height < 2 * DOWN:
        return None
    top, bottom = _middle(0, height / DOWN)
    code = 0
    for block in range(BLOCKS):
        left, right = _middle(block * width / ACROSS, width / ACROSS)
        color = bgr[top:bottom, left:right].reshape(-1, 3).mean(axis=0)
        if (np.abs(color - 127.5) < DOUBT).any():
            return None
        blue, green, red = (color > 127.5).tolist()
        code = code << BITS | red << 2 | green << 1 | blue
    number = code >> 8
    return number if coded(number) == code else None


def _middle(begin: float, length: float) -> tuple[int, int]:
    """Return the range of the middle half of a block, at least one pixel: its rim is blurred."""
    first = int(begin + length / 4)
    return first, max(first + 1, int(begin + length * 3 / 4))
