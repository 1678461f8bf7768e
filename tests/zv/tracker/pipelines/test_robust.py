"""The pipeline ``robust`` on painted frames."""

from __future__ import annotations

import threading
from typing import Any

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.foreground import ForegroundParameters
from zv.tracker.pipelines.base import enlarged, working_scale
from zv.tracker.pipelines.robust import RobustParameters, RobustTracker

TENTH = 100_000_000


def backdrop(width: int = 320, height: int = 240) -> np.ndarray:
    coarse = np.random.default_rng(4).uniform(60, 150, (15, 20, 3)).astype(np.float32)
    return cv2.resize(coarse, (width, height)).astype(np.uint8)


def frame(k: int) -> np.ndarray:
    """Return a frame in which two objects walk towards each other, past each other from 4 s on."""
    picture = backdrop()
    for x, y, color in ((4 * k - 150, 100, (20, 20, 200)), (470 - 4 * k, 106, (200, 60, 20))):
        if 0 <= x <= 295:
            picture[y : y + 70, x : x + 25] = color
    return picture


def test_crossing_objects_are_located_and_keep_their_ids():
    robust = RobustTracker()
    before: dict[int, float] = {}
    for k in range(110):
        tracks = robust.update(frame(k), k * TENTH)
        confirmed = {t.id: t for t in tracks if t.state == "confirmed"}
        if k == 60:
            before = {number: np.sign(t.vx) for number, t in confirmed.items()}
    assert sorted(before.values()) == [-1, 1]
    assert {number: np.sign(t.vx) for number, t in confirmed.items()} == before
    by_direction = {np.sign(t.vx): t.box for t in confirmed.values()}
    assert by_direction[1] == pytest.approx((4 * 109 - 150, 100, 25, 70), abs=4)
    assert by_direction[-1] == pytest.approx((470 - 4 * 109, 106, 25, 70), abs=4)


def test_a_plain_object_that_stops_before_a_rough_background_stays_for_as_long_as_it_stands():
    rng = np.random.default_rng(0)
    rough = np.kron(rng.integers(60, 200, (20, 27)), np.ones((12, 12)))[:, :320].astype(np.int16)
    robust = RobustTracker()
    seen = []
    for k in range(250):  # enters at 4 s, and stands from 6.8 s on
        picture = np.repeat(rough[..., np.newaxis], 3, 2)
        right = min(8 * (k - 40), 220)
        picture[80:180, max(0, right - 40) : max(0, right)] = (60, 80, 150)
        noisy = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
        tracks = robust.update(noisy, k * TENTH)
        seen.append(any(each.state == "confirmed" for each in tracks))
    assert all(seen[68:])


@pytest.mark.parametrize(
    ("limits", "moved"),
    [
        ({"regions": (((60, 0), (300, 0), (300, 240), (60, 240)),)}, 0),
        ({"ignored": (((0, 0), (60, 0), (60, 240), (0, 240)),)}, 0),
        ({}, 8),
    ],
)
def test_a_part_that_stops_stays_wherever_the_border_is_over_which_it_came(
    limits: dict[str, Any], moved: int
):
    """A camera that was pushed by some pixels shows less on one side, where parts come in."""
    rng = np.random.default_rng(0)
    robust = RobustTracker(RobustParameters(foreground=ForegroundParameters(**limits)))
    for k in range(220):  # enters at 6 s, and stands from 8.8 s on
        picture = backdrop().astype(np.int16)
        right = min(8 * (k - 60), 220)
        picture[80:150, max(0, right - 40) : max(0, right)] = (60, 80, 200)
        if k >= 30:
            picture[:, : 320 - moved] = picture[:, moved:].copy()
        noisy = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
        tracks = robust.update(noisy, k * TENTH)
    assert [(each.id, each.state) for each in tracks] == [(1, "confirmed")]


@pytest.mark.parametrize("waves", [True, False])
def test_what_comes_from_within_the_picture_stays_only_if_something_changes_in_it(waves: bool):
    rng = np.random.default_rng(0)
    robust = RobustTracker()
    for k in range(200):  # there from 4 s on, moves by 2.4 of its sides, stands from 5.5 s on
        picture = backdrop().astype(np.int16)
        if k >= 40:
            left = 100 + 4 * min(k - 40, 15)
            picture[80:150, left : left + 25] = (20, 20, 200)
            if waves and k % 14 < 7:
                picture[90:100, left + 5 : left + 15] = (200, 200, 20)
        noisy = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
        tracks = robust.update(noisy, k * TENTH)
        if k == 60:
            assert [each.state for each in tracks] == ["confirmed"]
    assert [each.state for each in tracks] == ["confirmed"] * waves
    assert np.any(robust.mask) == waves


def test_what_becomes_background_takes_nothing_of_an_object_that_overlaps_its_box():
    rng = np.random.default_rng(0)
    robust = RobustTracker()
    for k in range(130):
        picture = backdrop().astype(np.int16)
        left = max(200, 440 - 6 * k)  # comes in over the border, and stands from 4 s on
        picture[40:110, left : left + 40] = (30, 160, 30)
        if k >= 40:  # an L, which comes from within, and then holds the other in its angle
            left = 40 + 4 * min(k - 40, 30)
            picture[60:160, left : left + 16] = picture[144:160, left : left + 70] = (20, 20, 200)
        noisy = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
        tracks = robust.update(noisy, k * TENTH)
        if k == 90:
            assert [each.box for each in tracks] == [(200, 40, 40, 70), (160, 60, 70, 100)]
    assert [each.box for each in tracks] == [(200, 40, 40, 70)]
    assert np.count_nonzero(robust.mask) > 0.99 * 40 * 70


def test_a_reduced_picture_gives_coordinates_of_the_full_one():
    robust = RobustTracker()
    for k in range(70):
        half = cv2.resize(frame(k), (160, 120), interpolation=cv2.INTER_AREA)
        robust.update(np.asarray(half, np.uint8), k * TENTH, (640, 480))
    left = min((t for t in robust.tracks if t.state == "confirmed"), key=lambda t: t.x)
    assert left.box == pytest.approx((2 * (4 * 69 - 150), 200, 50, 140), abs=9)


def test_the_main_track_changes_only_to_a_clearly_larger_one():
    robust = RobustTracker()
    mains = [
        None if robust.update(frame(k), k * TENTH) is None else robust.centroid for k in range(110)
    ]
    ids = [main.id for main in mains if main is not None]
    assert ids
    assert len(set(ids)) == 1


def test_the_main_track_stays_where_it_is_expected_while_it_is_not_seen_for_0_3_s():
    robust, mains = RobustTracker(), []
    for k in range(66):
        shown = frame(k) if k < 60 else backdrop()
        robust.update(shown, k * TENTH)
        mains.append(robust.centroid)
    assert mains[59] is not None
    assert mains[59].state == "confirmed"
    gap = [None if main is None else (main.id, main.state) for main in mains[60:]]
    assert gap == [(mains[59].id, "lost")] * 3 + [None] * 3


def test_a_change_of_the_size_begins_new_tracks_with_unused_ids():
    robust = RobustTracker()
    for k in range(60):
        robust.update(frame(k), k * TENTH)
    known = {track.id for track in robust.tracks}
    assert known
    assert robust.update(backdrop(200, 100), 60 * TENTH) == []
    for k in range(61, 130):
        robust.update(frame(k - 30), k * TENTH)
    assert robust.tracks
    assert not known & {track.id for track in robust.tracks}


def test_the_background_and_the_mask_have_the_size_of_the_frame():
    robust = RobustTracker()
    with pytest.raises(ValueError, match="no frame"):
        robust.background()
    for k in range(30):
        robust.update(backdrop(640, 480), k * TENTH)
    background = robust.background()
    assert background.shape == (480, 640, 3)
    assert np.abs(background.astype(int) - backdrop(640, 480)).mean() < 3
    assert enlarged(robust.mask, (640, 480)).shape == (480, 640)


def test_a_query_has_a_background_while_sizes_and_settings_change_in_the_loop():
    """It comes on another thread, at any moment between two steps of the loop."""
    robust, ended, faults, shapes = RobustTracker(), threading.Event(), [], set()

    def ask() -> None:
        while not ended.is_set():
            try:
                shapes.add(robust.background().shape)
            except ValueError:  # there was no frame since a reset
                continue
            except Exception as fault:
                faults.append(fault)

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        for k in range(400):
            width, height = ((160, 120), (320, 240))[k // 10 % 2]
            robust.update(backdrop(width, height), k * TENTH)
            if k % 7 == 0:
                robust.reset()
            robust.parameters = RobustParameters(min_area=100 + k)
    finally:
        ended.set()
        thread.join()
    assert faults == []
    assert shapes == {(120, 160, 3), (240, 320, 3)}


def test_a_reset_learns_the_background_anew_and_keeps_the_tracks():
    robust = RobustTracker()
    for k in range(60):
        robust.update(frame(k), k * TENTH)
    last = robust.next_id
    robust.reset()
    robust.update(frame(60), 60 * TENTH)
    assert not robust.mask.any()
    assert robust.next_id == last


def test_a_changed_smallest_area_applies_to_the_next_frame():
    robust = RobustTracker()
    for k in range(60):
        robust.update(frame(k), k * TENTH)
    assert robust.tracks
    robust.parameters = RobustParameters(min_area=30_000)
    for k in range(60, 100):
        robust.update(frame(k), k * TENTH)
    assert not robust.tracks


@pytest.mark.parametrize(
    ("size", "scale"), [((768, 576), 2), ((1920, 1080), 4), ((640, 480), 2), ((320, 240), 1)]
)
def test_large_frames_are_processed_at_a_reduced_size(size: tuple[int, int], scale: int):
    assert working_scale(*size) == scale


def touching(k: int) -> np.ndarray:
    """Return a frame in which two objects that touch pass together, one above the other."""
    picture = backdrop()
    for left, top, width, height, color in (
        (5 * k - 120, 90, 40, 30, (20, 20, 200)),
        (5 * k - 112, 120, 48, 36, (20, 20, 200)),
    ):
        picture[top : top + height, max(0, left) : max(0, left + width)] = color
    return picture


@pytest.mark.parametrize("convex", [False, True])
def test_objects_that_touch_at_all_times_are_two_if_all_are_convex(convex: bool):
    robust = RobustTracker(RobustParameters(convex=convex))
    ids = set()
    for k in range(70):
        confirmed = [t for t in robust.update(touching(k), k * TENTH) if t.state == "confirmed"]
        ids |= {track.id for track in confirmed}
        if k == 50:
            boxes = sorted((track.box for track in confirmed), key=lambda box: box[1])
    assert len(ids) == len(boxes) == 1 + convex
    if convex:
        assert boxes[0] == pytest.approx((130, 90, 40, 30), abs=3)
        assert boxes[1] == pytest.approx((138, 120, 48, 36), abs=3)


@pytest.mark.parametrize(
    ("rate", "gap_s", "speed"), [(5, 1.0, 120), (10, 1.0, 120), (30, 0.6, 120)]
)
def test_objects_of_a_lane_with_much_traffic_are_confirmed_all_the_time(
    rate: int, gap_s: float, speed: int
):
    robust, first_at_s = RobustTracker(), 3.0
    seconds = 15 if rate == 10 else 18
    confirmed: set[int] = set()
    for k in range(seconds * rate):
        picture, time_s = backdrop(192, 144), k / rate
        for number in range(int((time_s - first_at_s) // gap_s) + 1):
            x = round(speed * (time_s - first_at_s - number * gap_s))
            color = ((20, 20, 200), (200, 60, 20), (20, 190, 30))[number % 3]
            picture[60:90, max(0, x - 18) : max(0, min(x, 192))] = color
        tracks = robust.update(picture, k * 1_000_000_000 // rate)
        confirmed |= {track.id for track in tracks if track.state == "confirmed"}
    passed = int((seconds - first_at_s - 192 / speed) / gap_s)
    assert len(confirmed) >= passed
