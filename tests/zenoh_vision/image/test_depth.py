"""Depth: millimetres, metres and no reading; the range that becomes 8 bits. Values by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.image import codecs
from zenoh_vision.image.depth import (
    WHOLE,
    RangeFinder,
    ValueRange,
    eight_bits,
    metres,
    millimetres,
)
from zenoh_vision.image.forms import RAW_FORM
from zenoh_vision.image.frame import Frame

ROOM = np.array([[0, 2000, 2500, 3000]], np.uint16)
"""No reading, then from 2 m to 3 m."""


def picture(*values: int) -> np.ndarray:
    return np.array([values], np.uint16)


@pytest.mark.parametrize(
    ("metre", "millimetre"),
    [
        (2.0, 2000),
        (1.2344, 1234),
        (1.2346, 1235),
        (0.0, 0),
        (-1.0, 0),
        (math.nan, 0),
        (math.inf, 0),
        (-math.inf, 0),
        (65.535, 65535),
        (70.0, 65535),
        (3.4e38, 65535),
    ],
)
def test_metres_become_millimetres_and_what_is_no_reading_becomes_0(metre, millimetre):
    found = millimetres(np.array([[metre]], np.float32))
    assert (found.dtype, found.tolist()) == (np.uint16, [[millimetre]])


def test_millimetres_become_metres_and_no_reading_is_nan():
    found = metres(ROOM)
    assert found.dtype == np.float32
    assert math.isnan(found[0, 0])
    assert found[0, 1:].tolist() == [2.0, 2.5, 3.0]


# 1 + 254 (v - 2000) / 1000: 2002 is 1.508, 2251 is 64.754, 2500 is 128.
@pytest.mark.parametrize(
    ("value", "eight"),
    [(0, 0), (1, 1), (2000, 1), (2002, 2), (2251, 65), (2500, 128), (3000, 255), (65535, 255)],
)
def test_a_range_of_values_becomes_1_to_255_and_no_reading_stays_0(value, eight):
    assert eight_bits(picture(value), ValueRange(2000, 3000)).tolist() == [[eight]]


def test_the_automatic_range_is_that_of_percentiles_1_and_99_of_the_readings():
    # 200 readings, 1001 to 1200: the 2nd and the 198th. Holes do not count.
    values = np.concatenate([np.zeros(500), np.arange(1001, 1201)]).astype(np.uint16)
    assert RangeFinder().range_of(values.reshape(70, 10)) == ValueRange(1002, 1198)


@pytest.mark.parametrize(
    ("limits", "found"),
    [
        ((None, None), (2000, 3000)),
        ((500, None), (500, 3000)),
        ((None, 9000), (2000, 9000)),
        ((500, 9000), (500, 9000)),
        ((4000, None), (4000, 4001)),
        ((65535, None), (65534, 65535)),
    ],
    ids=["automatic", "from", "to", "both", "from above all", "from the highest"],
)
def test_a_limit_that_is_set_counts(limits, found):
    assert RangeFinder(limits).range_of(ROOM) == ValueRange(*found)


def test_a_flat_picture_and_one_without_readings_have_a_range_too():
    assert RangeFinder().range_of(picture(700, 700)) == ValueRange(700, 701)
    assert RangeFinder().range_of(picture(0, 0)) == WHOLE == ValueRange(0, 65535)


def test_the_automatic_range_stays_while_it_fits_so_that_nothing_seems_to_move():
    finder = RangeFinder()
    first = finder.range_of(np.linspace(2000, 3000, 100).astype(np.uint16).reshape(10, 10))
    steps = [(2000, 2520, 5), (2000, 2520, 6), (2000, 2490, 0)]
    found = []
    for low, high, outside in steps:
        values = np.linspace(low, high, 100)
        values[:outside] = 4000
        found.append(finder.range_of(values.astype(np.uint16).reshape(10, 10)))
    assert found[0] == first, "5 % are outside, and what is inside spans more than half"
    assert found[1] != first, "6 % are outside"
    assert finder.range_of(picture(0, 0)) == found[2], "no reading says nothing of the range"


def test_a_range_of_which_less_than_half_is_used_is_found_anew():
    finder = RangeFinder()
    assert finder.range_of(picture(1000, 2000)) == ValueRange(1000, 2000)
    assert finder.range_of(picture(1300, 1800)) == ValueRange(1000, 2000), "half of it"
    assert finder.range_of(picture(1300, 1799)) == ValueRange(1300, 1799)


# A frame


def ranged(frame: Frame) -> Frame:
    frame.find_range(RangeFinder())
    return frame


@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
def test_a_frame_of_16_bits_has_its_values_and_grey_by_the_range_of_its_stream(encoding):
    made = ranged(Frame(header(encoding=encoding, width=4, height=1), ROOM))
    taken = ranged(Frame(made.header, made.compressed))
    assert taken.picture.mime == "image/png"
    for frame in (made, taken):
        assert frame.is_deep
        assert frame.depth is not None
        assert frame.depth.tolist() == ROOM.tolist()
        assert frame.value_range == ValueRange(2000, 3000)
        assert frame.gray.tolist() == [[0, 1, 128, 255]]
        assert frame.bgr[0, 2].tolist() == [128] * 3
        assert frame.pixels.tolist() == ROOM.tolist()
        assert frame.reduced("mono8", 4, 1).tolist() == frame.gray.tolist()


def test_without_a_finder_16_bits_are_scaled_as_a_whole():
    frame = Frame(header(encoding="16UC1", width=4, height=1), ROOM)
    assert frame.value_range is None
    assert frame.gray.tolist() == [[0, 8, 10, 12]]


def test_depth_in_metres_is_raw_as_it_is_and_a_png_of_millimetres_compressed():
    deep = np.array([[math.nan, 2.0, 2.5, 3.0]], np.float32)
    frame = ranged(Frame(header(encoding="32FC1", width=4, height=1), deep))
    assert frame.raw == np.array([[math.nan, 2.0, 2.5, 3.0]], "<f4").tobytes()
    assert codecs.decode_png(frame.compressed).tolist() == ROOM.tolist()
    assert frame.header.encoding == "32FC1"
    assert frame.gray.tolist() == [[0, 1, 128, 255]]
    raw = RAW_FORM.open(frame.raw, frame.header, None)
    assert ranged(Frame(frame.header, raw)).gray.tolist() == [[0, 1, 128, 255]]


def test_a_bare_png_of_16_bits_is_known_by_its_own_header():
    assumed = header(encoding="bgr8", width=4, height=1)
    frame = ranged(Frame(assumed, codecs.encode_png(ROOM)))
    assert frame.bgr[0].tolist() == [[0] * 3, [1] * 3, [128] * 3, [255] * 3]
    assert frame.depth is not None
    assert frame.depth.tolist() == ROOM.tolist()


def test_colour_of_16_bits_is_no_depth():
    colour = np.full((1, 4, 3), 257 * 7, np.uint16)
    frame = ranged(Frame(header(width=4, height=1), codecs.encode_png(colour)))
    assert frame.depth is None
    assert frame.value_range is None
    assert (frame.bgr == 7).all()


def test_a_jpeg_whose_header_claims_depth_is_shown_as_the_picture_that_it_is():
    jpeg = codecs.encode_jpeg(np.full((8, 8), 90, np.uint8), "mono8", 95)
    for encoding in ("mono16", "16UC1", "32FC1"):
        claimed = header(encoding=encoding, width=8, height=8)
        frame = ranged(Frame(claimed, jpeg))
        assert frame.depth is None
        assert (frame.gray == 90).all()
        assert frame.pixels.shape == (8, 8)


def test_a_frame_keeps_the_range_that_was_found_first_and_reading_it_changes_no_other():
    finder = RangeFinder()
    frame = Frame(header(encoding="16UC1", width=4, height=1), ROOM)
    frame.find_range(finder)
    finder.limits = (0, 1)
    frame.find_range(finder)
    assert frame.gray.tolist() == [[0, 1, 128, 255]]
    other = Frame(header(encoding="16UC1", width=4, height=1), ROOM * np.uint16(10))
    assert other.gray.any()  # by all values
    finder.limits = (None, None)
    frame = Frame(header(encoding="16UC1", width=4, height=1), ROOM)
    frame.find_range(finder)
    assert frame.value_range == ValueRange(2000, 3000)
