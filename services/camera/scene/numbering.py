"""The number of a frame as a strip of coloured blocks in its picture, drawn and read back.

So one can tell from what a screen shows which frame it is, however the picture came there. Eight
blocks from the top left corner, each as wide as a twentieth of the picture and as high as a
fifteenth, so squares at 4:3. A block has three bits: red, green, blue, the first one highest, each
all or nothing. The first 16 of the 24 bits are the number, the highest first; the last 8 are its
two bytes and ``CHECK``, combined by exclusive or. All lengths are shares of the picture, so a
picture that was scaled or stretched reads the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MODULUS = 2**16
"""Numbers are counted modulo this."""

CHECK = 0xA5  # so that a picture of one colour all over has no number
BLOCKS = 8
ACROSS = 20  # blocks that would fit side by side
DOWN = 15
BITS = 3  # of a block
DOUBT = 32  # grey levels on either side of the middle in which a bit is neither 0 nor 1


def extent(width: int, height: int) -> tuple[int, int]:
    """Return width and height of the strip in a picture of some size, pixels."""
    return max(1, round(width * BLOCKS / ACROSS)), max(1, round(height / DOWN))


def draw_number(bgr: NDArray[np.uint8], number: int) -> None:
    """Draw a number into a (height, width, 3) uint8 BGR picture, in place.

    Args:
        bgr: The picture; at least 160 pixels wide if it is to be read from a JPEG.
        number: 0 or more; shown modulo ``MODULUS``.
    """
    height, width = bgr.shape[:2]
    code = _coded(number % MODULUS)
    bits = [code >> shift & 1 for shift in range(BLOCKS * BITS - 1, -1, -1)]
    colors = 255 * np.array(bits, np.uint8).reshape(BLOCKS, BITS)[:, ::-1]
    across, down = extent(width, height)
    block_of = (2 * np.arange(across) + 1) * ACROSS // (2 * width)  # by the pixel's middle
    bgr[:down, :across] = colors[np.minimum(block_of, BLOCKS - 1)]


def read_number(bgr: NDArray[np.uint8]) -> int | None:
    """Return the number in a picture, or None if there is none or it cannot be read for certain.

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
    return number if _coded(number) == code else None


def _coded(number: int) -> int:
    """Return a number of 16 bits with the 8 bits that check it."""
    return number << 8 | (number >> 8 ^ number & 0xFF ^ CHECK)


def _middle(begin: float, length: float) -> tuple[int, int]:
    """Return the pixels of the middle half of a block, at least one: the rim is blurred."""
    first = int(begin + length / 4)
    return first, max(first + 1, int(begin + length * 3 / 4))
