"""The tracker is the tutorial's program, to the pixel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from zv.tracker.camera_tracking import largest_parameters as parameters_of
from zv.tracker.pipelines.largest import LargestObject, draw
from zv.tracker.settings import TrackerSettings


class Tutorial:
    """The loop of "Real-Time Object Tracking Using OpenCV and a Webcam", call by call.

    Only the camera, the window and the numbers that a test changes are not the tutorial's.
    """

    def __init__(
        self, history=700, var_threshold=25, shadows=True, closing=20, median=5, threshold=127
    ):
        self.back_sub = cv2.createBackgroundSubtractorMOG2(
            history=history, varThreshold=var_threshold, detectShadows=shadows
        )
        self.kernel = np.ones((closing, closing), np.uint8)
        self.median = median
        self.threshold = threshold

    def loop(self, frame):
        """Return box and centre or None, and the mask; draw on the frame."""
        fg_mask = self.back_sub.apply(frame)
        fg_mask = cv2.morphologyEx(fg_mask, cv2.MORPH_CLOSE, self.kernel)
        fg_mask = cv2.medianBlur(fg_mask, self.median)
        _, fg_mask = cv2.threshold(fg_mask, self.threshold, 255, cv2.THRESH_BINARY)
        fg_mask_bb = fg_mask
        contours, _hierarchy = cv2.findContours(fg_mask_bb, cv2.RETR_TREE, cv2.CHAIN_APPROX_SIMPLE)[
            -2:
        ]
        areas = [cv2.contourArea(c) for c in contours]
        if len(areas) < 1:
            return None, fg_mask
        max_index = np.argmax(areas)
        cnt = contours[max_index]
        x, y, w, h = cv2.boundingRect(cnt)
        cv2.rectangle(frame, (x, y), (x + w, y + h), (0, 255, 0), 3)
        x2 = x + int(w / 2)
        y2 = y + int(h / 2)
        cv2.circle(frame, (x2, y2), 4, (0, 255, 0), -1)
        text = "x: " + str(x2) + ", y: " + str(y2)
        cv2.putText(frame, text, (x2 - 10, y2 - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 255, 0), 2)
        return ((x, y, w, h), (x2, y2)), fg_mask


def check(frame: np.ndarray, tutorial: Tutorial, ours: LargestObject) -> bool:
    """Compare one frame's results; return whether something moved."""
    drawn = frame.copy()
    before = frame.copy()
    expected, expected_mask = tutorial.loop(drawn)
    found, mask = ours.update(frame)
    assert np.array_equal(mask, expected_mask)
    assert (found and (found.box, found.center)) == expected
    assert np.array_equal(draw(frame, found), drawn)
    assert np.array_equal(frame, before)
    return found is not None


def test_all_795_frames_of_a_real_video_have_the_results_of_the_tutorial(
    real_data: Callable[[str], Path],
):
    """At a quarter of its size, to take less time; the test below has the full size."""
    video = cv2.VideoCapture(str(real_data("vtest.avi")))
    tutorial, ours = Tutorial(), LargestObject(parameters_of(TrackerSettings()))
    frames = moving = 0
    while (read := video.read())[0]:
        moving += check(cv2.pyrDown(cv2.pyrDown(read[1])), tutorial, ours)
        frames += 1
    video.release()
    assert frames == 795
    assert 700 < moving <= 795


def test_the_first_100_frames_of_a_real_video_have_the_results_of_the_tutorial(
    real_data: Callable[[str], Path],
):
    video = cv2.VideoCapture(str(real_data("vtest.avi")))
    tutorial, ours = Tutorial(), LargestObject(parameters_of(TrackerSettings()))
    moving = sum(check(video.read()[1], tutorial, ours) for _ in range(100))
    video.release()
    assert moving > 90


def walkers(count: int) -> Iterator[np.ndarray]:
    """Yield a small noisy scene with two squares that come, one larger than the other."""
    noise = np.random.default_rng(5)
    for k in range(count):
        frame = noise.normal(90, 4, (90, 120, 3)).clip(0, 255).astype(np.uint8)
        if k > 10:
            frame[10:24, k : k + 14] = 200
            frame[50:75, 110 - k : 130 - k] = (60, 60, 62)  # much like its own shadow
        yield frame


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"history": 30},
        {"var_threshold": 4},
        {"shadows": False},
        {"closing": 3},
        {"closing": 0},
        {"median": 9},
        {"median": 0},
        {"threshold": 126},
        {"threshold": 254},
    ],
    ids=str,
)
def test_each_number_of_the_tutorial_can_be_changed(changed: dict):
    names = {"shadows": "detect_shadows"}
    settings = {names.get(name, name): value for name, value in changed.items()}
    ours = LargestObject(parameters_of(TrackerSettings.model_validate(settings)))
    # A kernel of 1x1 and a median of 1 change nothing: how the tutorial would leave a step out.
    steps = {name: value or 1 for name, value in changed.items() if name in ("closing", "median")}
    tutorial = Tutorial(**changed | steps)
    assert sum(check(frame, tutorial, ours) for frame in walkers(60)) > 30


def test_each_number_changes_the_result_in_this_scene():
    """Otherwise the test above would pass without comparing them."""
    numbers: list[dict] = [{"history": 30}, {"var_threshold": 4}, {"shadows": False}]
    numbers += [{"closing": 3}, {"median": 9}, {"threshold": 126}]
    plain = [mask.sum() for _, mask in map(Tutorial().loop, walkers(60))]
    for changed in numbers:
        other = [mask.sum() for _, mask in map(Tutorial(**changed).loop, walkers(60))]
        assert other != plain, changed
