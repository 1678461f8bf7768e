"""How a picture goes on the wire."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.messages import Header
from zenoh_vision.transport.publisher import LazyPayload, Outgoing, encoded_picture

GREY = np.arange(64 * 48, dtype=np.uint32).reshape(48, 64).astype(np.uint8)


def grey_header() -> Header:
    return header(0).model_copy(update={"encoding": "mono8"})


def decoded(sample: Outgoing) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(sample.payload, np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_grey_picture_keeps_its_greys_as_png():
    sample = encoded_picture(GREY, grey_header(), jpeg_quality=None, bilevel=False)
    assert sample.encoding == "image/png"
    assert np.array_equal(decoded(sample), GREY)


def test_a_picture_of_0_and_255_takes_one_bit_a_pixel():
    mask = np.where(GREY > 100, 255, 0).astype(np.uint8)
    sample = encoded_picture(mask, grey_header(), jpeg_quality=None, bilevel=True)
    assert sample.payload[24] == 1  # bit depth, byte 24 of a PNG
    assert np.array_equal(decoded(sample), mask)


@pytest.mark.parametrize("quality", [20, 95])
def test_a_jpeg_carries_its_header_beside_it(quality: int):
    sample = encoded_picture(GREY, grey_header(), jpeg_quality=quality, bilevel=False)
    assert sample.encoding == "image/jpeg"
    assert Header.from_bytes(sample.attachment or b"") == grey_header()
    assert decoded(sample).shape == GREY.shape


def test_a_sample_is_made_when_first_asked_for_and_only_once():
    made: list[int] = []

    def make() -> Outgoing:
        made.append(1)
        return Outgoing(b"x", "text/plain", None)

    once = LazyPayload(make)
    assert not made
    assert once() is once()
    assert made == [1]
