"""The rate of a live source is limited; pictures that do not change, or lag, are found."""

from __future__ import annotations

import numpy as np
import pytest

from zenoh_vision.image.picture import JpegPicture, Picture, PixelPicture
from zenoh_vision.image.planar import PlanarPicture
from zv.camera.frame_filter import FrameFilter
from zv.camera.lag import LagMonitor

NOISE = np.random.default_rng(4).integers(0, 256, (10, 12, 3), np.uint8)


def pixels(change: tuple[int, int, int] | None = None, like: np.ndarray = NOISE) -> Picture:
    array = like.copy()
    if change is not None:
        array[change] ^= 1
    return PixelPicture(array)


def packet(jpeg: bytes) -> Picture:
    return JpegPicture(jpeg, size=(12, 10))


def planar(red: int = 128) -> Picture:
    planes = (NOISE[:, :, 0], NOISE[:5, :6, 1], np.full((5, 6), red, np.uint8))
    return PlanarPicture(planes, full_range=True, to_bgr=NOISE.copy)


def test_the_first_picture_repeats_nothing():
    frames = FrameFilter()
    assert frames.still_s == 0.0
    assert not frames.is_repeat(pixels(), 100.0)
    assert frames.still_s == 0.0


REPEATS = {
    "equal": (pixels(), pixels(), True),
    "middle row": (pixels(), pixels((5, 0, 0)), False),  # which is compared first
    "first pixel": (pixels(), pixels((0, 0, 0)), False),
    "last pixel": (pixels(), pixels((9, 11, 2)), False),
    "narrower": (pixels(), pixels(like=NOISE[:, :11]), False),
    "equal packets": (packet(b"\xff\xd8one"), packet(b"\xff\xd8one"), True),
    "other packets": (packet(b"\xff\xd8one"), packet(b"\xff\xd8two"), False),
    "packet, then pixels": (packet(b"\xff\xd8one"), pixels(), False),
    "equal planes": (planar(), planar(), True),
    "other planes": (planar(), planar(129), False),
}


@pytest.mark.parametrize(("one", "other", "same"), REPEATS.values(), ids=REPEATS)
def test_only_an_exactly_equal_picture_is_a_repeat(one: Picture, other: Picture, same: bool):
    frames = FrameFilter()
    frames.is_repeat(one, 0.0)
    assert frames.is_repeat(other, 0.1) is same


def test_a_picture_is_compared_with_the_one_before_not_the_first():
    frames, changes = FrameFilter(), (None, (0, 0, 0), None, None)
    found = [frames.is_repeat(pixels(change), 0.0) for change in changes]
    assert found == [False, False, False, True]


def test_a_picture_is_still_for_as_long_as_only_equal_ones_arrive():
    frames = FrameFilter()
    for at_s in (10.0, 11.0, 12.5):
        frames.is_repeat(pixels(), at_s)
    assert frames.still_s == 2.5
    assert not frames.is_repeat(pixels((0, 0, 0)), 13.5)
    assert frames.still_s == 0.0


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


def monitor(*ages: tuple[float, float, int]) -> LagMonitor:
    found = LagMonitor()
    for now_s, age_s, skipped in ages:
        found.note(now_s, age_s, skipped)
    return found


def test_a_source_whose_youngest_picture_is_too_old_lags():
    lag = monitor((10.0, 3.2, 0), (10.5, 3.0, 0))
    assert lag.words(10.6, 0.5).startswith("pictures are 3.0 s old when they come: the network or")
    assert lag.words(10.6, 3.1) == ""
    assert lag.words(10.6, 0.0) == ""  # no limit


def test_one_late_picture_is_no_lag_and_an_old_one_is_forgotten():
    assert monitor((10.0, 3.0, 0), (10.1, 0.1, 0)).words(10.2, 0.5) == ""
    assert monitor((10.0, 3.0, 0)).words(11.1, 0.5) == ""


def test_skipped_pictures_are_said_for_ten_seconds():
    lag = monitor((10.0, 0.1, 5), (15.0, 0.1, 2))
    assert lag.words(15.1, 0.5).startswith("7 pictures of the last 10 s were skipped")
    assert lag.words(20.5, 0.5).startswith("2 pictures")
    assert lag.words(25.5, 0.5) == ""


def test_lost_packets_are_said_for_ten_seconds():
    lag = LagMonitor()
    lag.note(10.0, 0.1, 0, 3)
    lag.note(15.0, 0.1, 0, 1)
    assert lag.loss_words(15.1).startswith("4 packets of the last 10 s were lost in the network")
    assert lag.loss_words(20.5).startswith("1 packets")
    assert lag.loss_words(25.5) == ""


def test_the_lag_is_that_of_the_newest_picture_of_the_last_second():
    lag = monitor((10.0, 3.2, 0), (10.5, 0.25, 0))
    assert lag.newest_ms(10.6) == 250
    assert lag.newest_ms(11.6) is None
    assert monitor().newest_ms(0.0) is None
