"""How a picture goes on the wire."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.messages import Header
from zenoh_vision.transport import publisher as publisher_module
from zenoh_vision.transport.publisher import Demand, LazyPayload, Outgoing, encoded_picture

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


def test_zenoh_is_asked_ten_times_a_second_whether_someone_subscribes(
    monkeypatch: pytest.MonkeyPatch,
):
    now_ns, asked = 5 * 10**9, 0
    matching = False

    class Asked:
        @property
        def matching_status(self) -> SimpleNamespace:
            nonlocal asked
            asked += 1
            return SimpleNamespace(matching=matching)

    clock = SimpleNamespace(monotonic_ns=lambda: now_ns)
    monkeypatch.setattr(publisher_module, "time", clock)
    demand = Demand(cast("Any", SimpleNamespace(current=Asked())))
    assert not demand.exists
    matching = True
    now_ns += 99_999_999
    assert not demand.exists
    now_ns += 1
    assert demand.exists
    matching = False
    assert demand.exists
    now_ns += 100_000_000
    assert not demand.exists
    assert asked == 3
