"""The rate of a live source is limited, and a frozen one is detected."""

from __future__ import annotations

import numpy as np
import pytest

from zenoh_vision.image.planar import PlanarPicture
from zv.camera.frame_filter import FrameFilter
from zv.camera.sources.base import Picture

NOISE = np.random.default_rng(4).integers(0, 256, (10, 12, 3), np.uint8)


def pixels(change: tuple[int, int, int] | None = None, like: np.ndarray = NOISE) -> Picture:
    array = like.copy()
    if change is not None:
        array[change] ^= 1
    return Picture("bgr8", array.shape[1], array.shape[0], pixels=array)


def packet(jpeg: bytes) -> Picture:
    return Picture("bgr8", 12, 10, jpeg=jpeg)


def planar(red: int = 128) -> Picture:
    planes = (NOISE[:, :, 0], NOISE[:5, :6, 1], np.full((5, 6), red, np.uint8))
    return Picture("bgr8", 12, 10, stored=PlanarPicture(planes, full_range=True, to_bgr=NOISE.copy))


def test_the_first_picture_repeats_nothing():
    frames = FrameFilter()
    assert not frames.frozen(100.0)
    assert not frames.is_repeat(pixels(), 1.0, 100.0)
    assert not frames.frozen(100.5)


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
        (planar(), planar(), True),
        (planar(), planar(129), False),
        (planar(), pixels(), False),
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
        "equal planes",
        "other planes",
        "planes, then pixels",
    ],
)
def test_only_an_exactly_equal_picture_is_a_repeat(one: Picture, other: Picture, same: bool):
    frames = FrameFilter()
    frames.is_repeat(one, 1.0, 0.0)
    assert frames.is_repeat(other, 1.0, 0.1) is same


def test_a_picture_is_compared_with_the_one_before_not_the_first():
    frames = FrameFilter()
    pictures = [pixels(), pixels((0, 0, 0)), pixels(), pixels()]
    assert [frames.is_repeat(picture, 1.0, 0.0) for picture in pictures] == [
        False,
        False,
        False,
        True,
    ]


def test_a_source_is_frozen_after_so_long_without_a_new_picture():
    frames = FrameFilter()
    frames.is_repeat(pixels(), 2.0, 10.0)
    for at_s, frozen in ((10.5, False), (11.9, False), (12.0, True), (13.0, True)):
        assert frames.is_repeat(pixels(), 2.0, at_s)
        assert frames.frozen(at_s) is frozen


def test_a_new_picture_thaws_it():
    frames = FrameFilter()
    for at_s in (10.0, 11.0, 12.0):
        frames.is_repeat(pixels(), 2.0, at_s)
    assert frames.frozen(12.0)
    assert not frames.is_repeat(pixels((0, 0, 0)), 2.0, 12.5)
    assert not frames.frozen(14.4)
    assert frames.frozen(14.5)


def test_a_source_that_may_repeat_its_pictures_is_never_frozen():
    frames = FrameFilter()
    for at_s in (10.0, 11.0, 12.0):
        assert not frames.is_repeat(pixels(), 0.0, at_s)
        assert not frames.frozen(at_s)
    assert not frames.is_repeat(pixels(), 2.0, 13.0)
    assert frames.is_repeat(pixels(), 2.0, 14.0)
    assert not frames.frozen(14.0)


def passed(rate_hz: float, times_s: np.ndarray) -> np.ndarray:
    frames = FrameFilter()
    return times_s[[frames.allow(rate_hz, time_s) for time_s in times_s.tolist()]]


@pytest.mark.parametrize(
    ("source_hz", "rate_hz", "expected_hz"),
    [
        (30, 5, 5),
        (30, 10, 10),
        (30, 20, 20),
        (30, 25, 25),
        (30, 29.97, 29.97),
        (30, 30, 30),
        (30, 60, 30),
        (60, 25, 25),
        (12.5, 10, 10),
        (1, 0.25, 0.25),
    ],
)
def test_the_rate_is_what_was_asked_or_the_sources(
    source_hz: float, rate_hz: float, expected_hz: float
):
    seconds = 400
    times = 50.0 + np.arange(int(seconds * source_hz)) / source_hz
    assert abs(len(passed(rate_hz, times)) - expected_hz * seconds) <= 1


def test_jitter_does_not_halve_a_source_of_just_the_rate_asked():
    jitter = np.random.default_rng(3).uniform(-0.004, 0.004, 3000)
    times = np.arange(3000) / 30 + jitter
    assert len(passed(30, times)) == 3000


def test_a_source_much_faster_than_the_rate_is_thinned_evenly():
    gaps = np.diff(passed(10, np.arange(3000) / 300))
    assert gaps.min() >= 0.1 - 0.025  # a quarter of a period early at most
    assert gaps.max() <= 0.1 + 1 / 300


def test_a_burst_after_a_pause_is_thinned_too():
    before = np.arange(30) / 30
    burst = 100.0 + np.arange(50) / 1000  # what a stalled link held back, in 50 ms
    after = passed(10, np.concatenate([before, burst]))
    assert np.count_nonzero(after >= 100.0) <= 2


def test_without_a_rate_everything_is_passed_and_another_rate_begins_anew():
    frames = FrameFilter()
    assert [frames.allow(1.0, now_s) for now_s in (0.0, 0.1)] == [True, False]
    assert [frames.allow(None, now_s) for now_s in (0.2, 0.21)] == [True, True]
    assert [frames.allow(2.0, now_s) for now_s in (0.3, 0.4)] == [True, False]
