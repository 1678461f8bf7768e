"""One bit a pixel, there and back, and byte counts that do not fit."""

from __future__ import annotations

import numpy as np
import pytest

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.bits import bits_size, pack_bits, unpack_bits


def test_the_leftmost_pixel_is_the_highest_bit_and_each_row_begins_with_a_byte():
    picture = np.zeros((2, 10), np.uint8)
    picture[0, 0] = picture[0, 7] = picture[0, 8] = 255
    picture[1, 9] = 1
    assert pack_bits(picture) == bytes([0b10000001, 0b10000000, 0b00000000, 0b01000000])


@pytest.mark.parametrize("shape", [(1, 1), (1, 8), (3, 9), (50, 641)], ids=str)
def test_bits_are_unpacked_to_0_and_255(shape: tuple[int, int]):
    picture = (np.random.default_rng(1).random(shape) < 0.5) * np.uint8(255)
    bits = pack_bits(picture)
    assert len(bits) == bits_size(shape[1], shape[0])
    assert np.array_equal(unpack_bits(memoryview(bits), shape[1], shape[0]), picture)


@pytest.mark.parametrize("bits", [b"", b"\0", b"\0\0\0"])
def test_a_wrong_number_of_bytes_is_refused(bits: bytes):
    with pytest.raises(PayloadError, match="wrong_size"):
        unpack_bits(bits, 9, 1)
