"""Draws the number of a frame as a strip of coloured blocks in its picture.

A test can then tell which frame a screen shows, however the picture got there. The strip has
eight blocks from the top left corner, each 1/20 of the picture's width and 1/15 of its height,
which are squares at 4:3. A block encodes three bits, red, green and blue, each 0 or 255, red the
highest. The first 16 of the 24 bits are the number, highest first; the last 8 are the exclusive or
of its two bytes and ``CHECK``. All lengths are shares of the picture, so that a picture can also
be read after scaling or stretching.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MODULUS = 2**16
"""Numbers are shown modulo this."""

CHECK = 0xA5  # makes a picture of one colour invalid
BLOCKS = 8
ACROSS = 20  # blocks that fit side by side
DOWN = 15
BITS = 3  # per block


def extent(width: int, height: int) -> tuple[int, int]:
    """Return width and height of the strip in a picture of this size, pixels."""
    return max(1, round(width * BLOCKS / ACROSS)), max(1, round(height / DOWN))


def draw_number(bgr: NDArray[np.uint8], number: int) -> None:
    """Draw a number into a (height, width, 3) uint8 BGR picture, in place.

    Args:
        bgr: The picture; at least 160 pixels wide if it is to be read from a JPEG.
        number: 0 or more; shown modulo ``MODULUS``.
    """
    height, width = bgr.shape[:2]
    code = coded(number % MODULUS)
    bits = [code >> shift & 1 for shift in range(BLOCKS * BITS - 1, -1, -1)]
    colors = 255 * np.array(bits, np.uint8).reshape(BLOCKS, BITS)[:, ::-1]
    across, down = extent(width, height)
    block_of = (2 * np.arange(across) + 1) * ACROSS // (2 * width)  # by the pixel's middle
    bgr[:down, :across] = colors[np.minimum(block_of, BLOCKS - 1)]


def coded(number: int) -> int:
    """Return a number of 16 bits followed by its 8 check bits."""
    return number << 8 | (number >> 8 ^ number & 0xFF ^ CHECK)
