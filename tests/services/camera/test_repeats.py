"""A source that shows the same picture again and again is frozen."""

from __future__ import annotations

import numpy as np
import pytest

from services.camera.repeats import RepeatWatch
from services.camera.sources.base import Picture

NOISE = np.random.default_rng(4).integers(0, 256, (10, 12, 3), np.uint8)


def pixels(change: tuple[int, int, int] | None = None, like: np.ndarray = NOISE) -> Picture:
    array = like.copy()
    if change is not None:
        array[change] ^= 1
    return Picture("bgr8", array.shape[1], array.shape[0], pixels=array)


def packet(jpeg: bytes) -> Picture:
    return Picture("bgr8", 12, 10, jpeg=jpeg)


def test_the_first_picture_repeats_nothing():
    watch = RepeatWatch(1.0)
    assert not watch.frozen(100.0)
    assert not watch.repeats(pixels(), 100.0)
    assert not watch.frozen(100.5)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (pixels(), pixels(), True),
        (pixels(), pixels((5, 0, 0)), False),  # in the row that is looked at first
        (pixels(), pixels((0, 0, 0)), False),
        (pixels(), pixels((9, 11, 2)), False),
        (pixels(), pixels(like=NOISE[:, :11]), False),
        (pixels(), pixels(like=NOISE[:8]), False),
        (packet(b"\xff\xd8one"), packet(b"\xff\xd8one"), True),
        (packet(b"\xff\xd8one"), packet(b"\xff\xd8two"), False),
        (packet(b"\xff\xd8one"), pixels(), False),
        (pixels(), packet(b"\xff\xd8one"), False),
    ],
    ids=[
        "equal",
        "middle row",
        "first pixel",
        "last pixel",
        "narrower",
        "lower",
        "equal packets",
        "other packets",
        "packet, then pixels",
        "pixels, then packet",
    ],
)
def test_only_an_exactly_equal_picture_is_a_repeat(one: Picture, other: Picture, same: bool):
    watch = RepeatWatch(1.0)
    watch.repeats(one, 0.0)
    assert watch.repeats(other, 0.1) is same


def test_a_picture_is_compared_with_the_one_before_not_the_first():
    watch = RepeatWatch(1.0)
    pictures = [pixels(), pixels((0, 0, 0)), pixels(), pixels()]
    assert [watch.repeats(picture, 0.0) for picture in pictures] == [False, False, False, True]


def test_a_source_is_frozen_after_so_long_without_a_new_picture():
    watch = RepeatWatch(2.0)
    watch.repeats(pixels(), 10.0)
    for at_s, frozen in ((10.5, False), (11.9, False), (12.0, True), (13.0, True)):
        assert watch.repeats(pixels(), at_s)
        assert watch.frozen(at_s) is frozen


def test_a_new_picture_thaws_it():
    watch = RepeatWatch(2.0)
    for at_s in (10.0, 11.0, 12.0):
        watch.repeats(pixels(), at_s)
    assert watch.frozen(12.0)
    assert not watch.repeats(pixels((0, 0, 0)), 12.5)
    assert not watch.frozen(14.4)
    assert watch.frozen(14.5)
