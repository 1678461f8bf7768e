"""The largest moving object in scenes where it is known; test_tutorial.py has many more."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from zv.tracker.camera_tracking import largest_parameters as parameters_of
from zv.tracker.pipelines.largest import LargestObject, LargestObjectParameters, MovingObject, draw
from zv.tracker.settings import TrackerSettings

TUTORIAL = parameters_of(TrackerSettings())


def room() -> np.ndarray:
    return np.full((120, 160, 3), 90, np.uint8)


def warmed_up(**changes) -> LargestObject:
    """Return a tracker that has seen the empty room for four seconds."""
    tracker = LargestObject(replace(TUTORIAL, **changes))
    for _ in range(40):
        tracker.update(room())
    return tracker


def test_a_square_is_found_exactly_without_closing_and_median():
    scene = room()
    scene[40:70, 60:90] = 220
    found, mask = warmed_up(closing=0, median=0).update(scene)
    # The contour runs through the centres of the border pixels: 29 x 29 = 841.
    assert found == MovingObject((60, 40, 30, 30), 841.0)
    assert found.center == (75, 55)
    assert np.array_equal(np.argwhere(mask == 255), np.argwhere(scene[:, :, 0] == 220))
    assert set(np.unique(mask)) == {0, 255}


def test_a_square_is_found_one_pixel_down_and_right_by_the_tutorials_kernel():
    """The 20x20 kernel has no middle: dilation reaches 9 up and left and 10 down and right of
    a pixel, erosion takes 10 and 9 away: 60..89 becomes 61..90.

    The median of 5x5 = 25 needs 13. A corner pixel sees 9, its neighbours along the edges
    4 x 3 = 12, the next 5 x 3 = 15: each corner loses 3 pixels, and the contour a triangle of
    2 x 2 / 2 = 2: 841 - 4 x 2 = 833.
    """
    scene = room()
    scene[40:70, 60:90] = 220
    found, mask = warmed_up().update(scene)
    assert found == MovingObject((61, 41, 30, 30), 833.0)
    assert found.center == (76, 56)
    assert np.count_nonzero(mask) == 30 * 30 - 4 * 3


def test_of_equally_large_objects_the_first_contour_of_opencv_is_found():
    scene = room()
    scene[20:40, 20:40] = 220
    scene[80:100, 100:120] = 220
    found, mask = warmed_up(closing=0, median=0).update(scene)
    contours, _ = cv2.findContours(mask, cv2.RETR_TREE, cv2.CHAIN_APPROX_SIMPLE)
    assert [cv2.contourArea(contour) for contour in contours] == [361.0, 361.0]  # 19 x 19
    assert found == MovingObject(cv2.boundingRect(contours[0]), 361.0)


def test_a_single_pixel_counts():
    scene = room()
    scene[5, 7] = 255
    found, _ = warmed_up(closing=0, median=0).update(scene)
    assert found == MovingObject((7, 5, 1, 1), 0.0)


@pytest.mark.parametrize("numbers", [{}, {"closing": 0, "median": 0}], ids=["tutorial", "bare"])
def test_each_mask_is_a_new_array(numbers: dict):
    """It is encoded later, on another thread, while the next frame is in work."""
    tracker = warmed_up(**numbers)
    scene = room()
    scene[40:70, 60:90] = 220
    _, first = tracker.update(scene)
    kept = first.copy()
    _, second = tracker.update(room())
    assert first is not second
    assert not np.shares_memory(first, second)
    assert np.array_equal(first, kept)


def test_a_new_tracker_has_learned_no_background():
    """A first frame of black pixels is all foreground, as MOG2 has it; the next is background."""
    black = np.zeros((120, 160, 3), np.uint8)
    tracker = LargestObject(TUTORIAL)
    found, _ = tracker.update(black)
    assert found is not None
    assert found.box == (0, 0, 160, 120)
    assert tracker.update(black)[0] is None


def test_nothing_is_drawn_when_nothing_moves():
    frame = room()
    assert draw(frame, None) is frame


OTHERS = LargestObjectParameters(
    history=50, var_threshold=6.0, detect_shadows=False, closing=3, median=3, threshold=100
)


def noisy(count: int) -> list[np.ndarray]:
    random = np.random.default_rng(3)
    return [random.normal(90, 4, (120, 160, 3)).clip(0, 255).astype(np.uint8) for _ in range(count)]


def test_parameters_set_before_the_first_frame_act_like_those_of_the_constructor():
    adjusted, made = LargestObject(TUTORIAL), LargestObject(OTHERS)
    adjusted.adjust(OTHERS)
    for frame in noisy(40):
        (found, mask), (expected, expected_mask) = adjusted.update(frame), made.update(frame)
        assert found == expected
        assert np.array_equal(mask, expected_mask)


def test_changed_parameters_keep_the_learned_background():
    scene = room()
    scene[40:70, 60:90] = 220
    tracker = warmed_up()
    tracker.adjust(replace(OTHERS, closing=0, median=0))
    found, _ = tracker.update(scene)
    assert found == MovingObject((60, 40, 30, 30), 841.0)
    new, _ = LargestObject(OTHERS).update(scene)
    assert new.box == (0, 0, 160, 120)  # which knows no background
