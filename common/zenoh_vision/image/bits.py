"""Bilevel pictures as packed bits, for programs that have no decoder of PNG."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError


def pack_bits(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture as one bit a pixel: 1 where it is not 0.

    The leftmost pixel is the highest bit of a byte; each row begins with a new byte, whose spare
    bits are 0.

    Args:
        picture: (height, width) uint8.
    """
    return np.packbits(picture != 0, axis=1).tobytes()


def unpack_bits(bits: bytes | memoryview, width: int, height: int) -> NDArray[np.uint8]:
    """Return packed bits as (height, width) uint8, 0 or 255.

    Raises:
        PayloadError: ``wrong_size``.
    """
    expected = bits_size(width, height)
    if len(bits) != expected:
        raise PayloadError("wrong_size", f"{len(bits)} bytes of bits instead of {expected}")
    rows = np.frombuffer(bits, np.uint8).reshape(height, -1)
    return np.unpackbits(rows, axis=1, count=width) * np.uint8(255)


def bits_size(width: int, height: int) -> int:
    """Return the number of bytes of a picture's bits."""
    return (width + 7) // 8 * height
