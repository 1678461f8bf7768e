"""A dynamic background: changing pixels are not foreground, objects before them are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.dynamic_background import DynamicBackground
from zv.tracker.foreground.foreground import ForegroundDetector, ForegroundParameters

SECOND = 1_000_000_000
GREEN, PALE, RED = (40, 120, 60), (170, 170, 160), (30, 30, 220)


def backdrop() -> np.ndarray:
    """Return (120, 160, 3) with texture, between 60 and 150."""
    coarse = np.random.default_rng(2).uniform(60, 150, (15, 20, 3)).astype(np.float32)
    return cv2.resize(coarse, (160, 120)).astype(np.uint8)


def flickering(time_s: float, *, changes_after_s: float = 0.45) -> np.ndarray:
    """Return the backdrop with a screen at columns 40 to 80 and rows 30 to 80, of two colours."""
    picture = backdrop()
    picture[30:80, 40:80] = GREEN if int(time_s / changes_after_s + 1e-6) % 2 else PALE
    return picture


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_a_screen_that_flickers_becomes_background_within_10_s_and_an_object_before_it_is_seen(
    rate: int,
):
    found = ForegroundDetector(ForegroundParameters())
    for k in range(15 * rate):
        mask, _ = found.update(flickering(k / rate), k * SECOND // rate, [])
        assert k < 10 * rate or not mask.any()
    for k in range(15 * rate, 78 * rate // 5):  # one passes it at 40 pixels a second
        picture, x = flickering(k / rate), 40 + 40 * (k - 15 * rate) // rate
        picture[50:80, x : x + 15] = RED
        mask, _ = found.update(picture, k * SECOND // rate, [])
        assert (
            np.count_nonzero(mask[50:80, x : x + 15]) >= 30 * 15 - 8
        )  # the corners, by the median


def test_pixels_passed_now_and_then_by_objects_of_one_colour_are_not_dynamic():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(600):  # one passes in a second, every 4 s
        picture = backdrop()
        step = k % 40 - 20
        if 0 <= step < 10:
            picture[40:80, 16 * step : 16 * step + 12] = RED
        mask, _ = found.update(picture, k * SECOND // 10, [])
        if k > 20 and 0 <= step < 10:
            assert np.count_nonzero(mask[40:80, 16 * step : 16 * step + 12]) >= 40 * 12 - 8


def test_after_a_change_of_the_light_the_old_colours_do_not_count():
    dynamic = DynamicBackground()
    limits = np.full((120, 160, 3), 10, np.uint8)
    screen = np.s_[30:80, 40:80]
    for k in range(150):
        marked = np.zeros((120, 160), np.uint8)
        marked[screen] = 255 * (k // 5 % 2)
        shown = flickering(k / 10, changes_after_s=0.5)
        dynamic.learn(shown, marked, None, k * SECOND // 10, backdrop())
    seen, forgotten = np.full((2, 120, 160), 255, np.uint8)
    dynamic.unmark(flickering(0.0), limits, seen)
    assert not seen[screen].any()
    assert np.count_nonzero(seen) == 120 * 160 - 50 * 40
    dynamic.forget_colours()
    dynamic.unmark(flickering(0.0), limits, forgotten)
    assert forgotten.all()


def learned(rate: int, changes: int, calm_s: float) -> np.ndarray:
    """Return what is left of marks everywhere after changes, one every 0.8 s, and a calm."""
    dynamic, picture, times = DynamicBackground(), backdrop(), 0
    for k in range(round((0.8 * changes + calm_s) * rate)):
        times = min(changes, int(k / rate / 0.8))
        marked = np.zeros((120, 160), np.uint8)
        marked[:30] = 255 * (times % 2)  # a quarter: more would be a change of the light
        dynamic.learn(picture, marked, None, k * SECOND // rate, picture)
    seen = np.full((120, 160), 255, np.uint8)
    dynamic.unmark(picture, np.full((120, 160, 3), 10, np.uint8), seen)
    return seen[:30]


@pytest.mark.parametrize("rate", [30, 25, 10, 5])
def test_how_often_a_pixel_must_change_and_how_long_it_is_dynamic_do_not_depend_on_the_rate(
    rate: int,
):
    # Each change adds 10 and 0.8 s take 4 away: 60 are reached by the 10th, not by the 8th.
    assert learned(rate, 8, 0.8).all()
    assert not learned(rate, 12, 0.8).any()
    # After 25 changes there are at most 160; they fall below 60 after 20 s.
    assert not learned(rate, 25, 15).any()
    assert learned(rate, 25, 25).all()


def test_a_change_of_the_light_makes_no_pixel_dynamic():
    dynamic, picture = DynamicBackground(), backdrop()
    for k in range(150):
        marked = np.full((120, 160), 255 * (k // 5 % 2), np.uint8)
        dynamic.learn(picture, marked, None, k * SECOND // 10, picture)
    seen = np.full((120, 160), 255, np.uint8)
    dynamic.unmark(picture, np.full((120, 160, 3), 10, np.uint8), seen)
    assert seen.all()


def test_an_object_that_stands_before_a_screen_stays_foreground_after_a_change_of_the_light():
    dynamic = DynamicBackground()
    screen = np.s_[30:80, 40:80]
    known = np.zeros((120, 160), np.uint8)
    known[screen] = 255
    for k in range(180):
        shown, marked = flickering(k / 10, changes_after_s=0.5), np.zeros((120, 160), np.uint8)
        marked[screen] = 255 * (k // 5 % 2)
        if k == 150:
            dynamic.forget_colours()
        if k >= 150:
            shown[screen], marked[screen] = RED, 255
        hidden = known if k >= 150 else None
        dynamic.learn(shown, marked, hidden, k * SECOND // 10, backdrop())
    dynamic.unmark(shown, np.full((120, 160, 3), 10, np.uint8), marked)
    assert marked[screen].all()


def test_a_clock_that_is_set_back_a_little_leaves_pixels_dynamic():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(200):
        stamp_ns = k * SECOND // 10 - (SECOND // 5 if k > 150 else 0)
        mask, _ = found.update(flickering(k / 10), stamp_ns, [])
        assert k < 100 or not mask.any(), k
