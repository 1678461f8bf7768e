"""The eight ways to turn a picture, against NumPy's rotation of pixels."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.image.turn import Turn

PICTURE = np.arange(6 * 4).reshape(4, 6)
SIZE = (6, 4)
WAYS = [Turn(degrees, mirrored) for degrees, mirrored in product((0, 90, 180, 270), (False, True))]
FLIPS = {
    "none": lambda pixels: pixels,
    "horizontal": np.fliplr,
    "vertical": np.flipud,
    "both": lambda pixels: np.flipud(np.fliplr(pixels)),
}


def pixels(turn: Turn) -> np.ndarray:
    rotated = np.rot90(PICTURE, -(turn.degrees // 90))
    return np.fliplr(rotated) if turn.mirrored else rotated


@pytest.mark.parametrize(("rotate", "flip"), list(product((0, 90, 180, 270), FLIPS)))
def test_the_options_of_a_camera_are_one_of_eight_ways(rotate: int, flip: str):
    by_hand = FLIPS[flip](np.rot90(PICTURE, -(rotate // 90)))
    assert np.array_equal(pixels(Turn.of(rotate, flip)), by_hand)


@pytest.mark.parametrize("turn", WAYS, ids=str)
def test_points_boxes_and_sizes_are_where_the_pixels_are(turn: Turn):
    turned = pixels(turn)
    assert turn.size(SIZE) == turned.shape[::-1]
    for y, x in np.ndindex(PICTURE.shape):
        to_x, to_y = turn.point(x + 0.5, y + 0.5, SIZE)
        assert turned[int(to_y), int(to_x)] == PICTURE[y, x]
    left, top, width, height = turn.box((1, 2, 3, 2), SIZE)
    part = turned[top : top + height, left : left + width]
    assert set(part.flat) == set(PICTURE[2:4, 1:4].flat)
    assert turn.inverse.box((left, top, width, height), turn.size(SIZE)) == (1, 2, 3, 2)
    assert turn.vector(1, 2) == tuple(
        end - start
        for start, end in zip(turn.point(2, 1, SIZE), turn.point(3, 3, SIZE), strict=True)
    )


@pytest.mark.parametrize(("before", "now"), list(product(WAYS, WAYS)))
def test_what_is_turned_further_is_turned_as_it_is_now(before: Turn, now: Turn):
    x, y = before.point(1.5, 0.5, SIZE)
    further = now.since(before)
    assert further.point(x, y, before.size(SIZE)) == now.point(1.5, 0.5, SIZE)


def test_a_header_says_how_a_frame_is_turned():
    assert Turn.of_header(header()) == Turn()
    assert Turn.of_header(header(rotated=270, mirrored=True)) == Turn(270, mirrored=True)
