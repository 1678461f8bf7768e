"""Tracks of objects that meet, with pixels: one hides the other, or parts of one are connected."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import cv2
import numpy as np
import pytest

from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.track import Track
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

SIZE = (300, 120)  # width, height
SECOND = 1_000_000_000
RED, BLUE = (20, 20, 200), (200, 60, 20)
Box = tuple[float, float, float, float]  # left, top, width, height
Painted = Sequence[tuple[Box, tuple[int, int, int]]]


def tracked(frames: Iterable[Painted], rate: int = 20) -> list[list[Track]]:
    """Return the tracks of each frame of rectangles, of which the last is in front."""
    tracker, found = Tracker(TrackingParameters(), SIZE), []
    for k, objects in enumerate(frames):
        picture = np.full((SIZE[1], SIZE[0], 3), 120, np.uint8)
        mask = np.zeros(SIZE[::-1], np.uint8)
        for (left, top, width, height), color in objects:
            x, y = max(0, round(left)), max(0, round(top))
            window = np.s_[y : round(top + height), x : max(x, round(left + width))]
            picture[window], mask[window] = color, 255
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        regions = [cv2.boundingRect(outline) for outline in outlines]
        fragments = [
            Fragment(x, y, x + w, y + h, cv2.countNonZero(mask[y : y + h, x : x + w]))
            for x, y, w, h in regions
        ]
        found.append(tracker.update(fragments, k * SECOND // rate, Scene(picture, mask)))
    return found


@pytest.mark.parametrize("rate", [30, 10])
def test_a_standing_object_keeps_its_box_and_id_while_another_passes_behind(rate: int):
    frames: list[Painted] = []
    for k in range(6 * rate):
        time_s = k / rate
        large = (20 + 40 * min(time_s, 2), 10, 30, 100)
        small = (280 - 45 * time_s, 50, 40, 24)
        frames.append([(small, BLUE), (large, RED)])
    found = tracked(frames, rate)
    ids = {track.id for tracks in found[rate:] for track in tracks}
    assert len(ids) == 2
    for tracks in found[2 * rate :]:
        assert [track.state for track in tracks] == ["confirmed", "confirmed"]
        large = max(tracks, key=lambda each: each.box[3])
        assert large.box == pytest.approx((100, 10, 30, 100), abs=5)


def test_an_object_that_stops_behind_another_one_is_not_moved_on():
    frames: list[Painted] = []
    for k in range(120):
        time_s = k / 20
        small = (280 - 45 * min(time_s, 3.2), 50, 40, 24)  # ends at 136, half behind
        frames.append([(small, BLUE), ((120 + 0.0 * k, 10 + 4 * (k < 12), 30, 100), RED)])
    last = tracked(frames)[-1]
    blue = min(last, key=lambda each: each.box[3])
    assert blue.x == pytest.approx(136 + 20, abs=6)


def test_an_object_that_bounces_keeps_its_id():
    frames: list[Painted] = []
    for k in range(80):
        phase = (k / 20) % 1.0
        height = 240 * phase * (1 - phase)  # 60 at the highest, 240 pixels per second at the ground
        frames.append([((20 + 2.5 * k, 90 - height, 24, 24), RED)])
    found = tracked(frames)
    assert {track.id for tracks in found for track in tracks} == {1}
    assert found[-1][0].state == "confirmed"


def test_an_object_that_enters_in_two_parts_is_one_track_when_they_are_connected():
    frames: list[Painted] = []
    for k in range(60):
        head, legs = ((-26 + 2 * k, 10, 30, 24), RED), ((-24 + 2 * k, 60, 30, 50), BLUE)
        body = ((-30 + 2 * k, 30, 20, 40), RED)  # seen last
        frames.append([head, legs, body])
    found = tracked(frames)
    assert [len(found[k]) for k in (4, 12, 59)] == [2, 1, 1]
    assert found[-1][0].box[3] == pytest.approx(100, abs=6)


def test_a_track_expected_outside_of_the_picture_is_lost_at_once():
    frames: list[Painted] = [[((150 + 6 * k, 30, 24, 60), RED)] for k in range(40)]
    states = [[track.state for track in tracks] for tracks in tracked(frames)]
    gone = next(k for k in range(40) if 150 + 6 * k >= SIZE[0])
    assert states[gone - 2] == ["confirmed"]
    assert "confirmed" not in states[gone]


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_an_object_that_enters_is_confirmed_as_soon_as_its_edge_has_moved_far_enough(rate: int):
    # From 6 to 30 pixels in view in 0.4 s: 24 are 0.46 sides of the part in view, 12 were 0.23.
    frames: list[Painted] = [[((-54 + 60 * k / rate, 20, 60, 90), RED)] for k in range(rate)]
    states = [tracks[0].state for tracks in tracked(frames, rate)]
    assert states.index("confirmed") == round(0.4 * rate)


def test_two_tracks_of_an_object_that_was_divided_become_one():
    frames: list[Painted] = []
    for k in range(90):
        upper, lower = ((20 + 2 * k, 10, 24, 40), RED), ((20 + 2 * k, 70, 24, 40), BLUE)
        between = ((20 + 2 * k, 48, 24, 24), BLUE)  # a bar hides it at first
        frames.append([upper, lower] if k < 30 else [upper, lower, between])
    found = tracked(frames)
    assert len(found[25]) == 2
    assert [track.id for track in found[-1]] == [1]
    assert found[-1][0].box == pytest.approx((20 + 2 * 89, 10, 24, 100), abs=4)


def test_a_box_that_was_too_large_shrinks_as_soon_as_no_other_object_is_near():
    frames: list[Painted] = []
    for k in range(80):  # at 20 Hz
        small = (250 - 5 * k, 100, 14, 14)  # passes the large one until 1.9 s
        large = (60 + k / 2, 20, 90 if k < 44 else 30, 90)
        frames.append([(large, RED), (small, BLUE)])
    found = tracked(frames)
    width, height = found[44 + 20][0].box[2:]
    assert height == pytest.approx(90, abs=8)
    assert width < 30 + 60 * 0.37 + 5  # 63 % of the way within 0.7 s, here 1 s


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_a_head_briefly_separate_from_its_body_does_not_become_a_track(rate: int):
    frames: list[Painted] = []
    for k in range(4 * rate):
        time_s = k / rate
        left = 10 + 40 * time_s
        whole, head = (left, 30, 20, 60), (left + 5, 30, 10, 8)
        body = (left, 40, 20, 50)
        seen = [body] if 1.2 <= time_s < 2.2 else [body, head] if 2.2 <= time_s < 2.5 else [whole]
        frames.append([(part, RED) for part in seen])
    found = tracked(frames, rate)
    assert [track.state for track in found[-1]] == ["confirmed"]
    assert found[-1][0].id == found[rate][0].id
    for tracks in found:
        assert sum(track.state == "confirmed" for track in tracks) <= 1


def behind_a_sign(rate: int) -> list[Painted]:
    """Return 4 s of a walking person behind a sign.

    Whole at first; from 1.6 s on only the legs, from 2.8 s on head and legs apart, and from 3.1 s
    on whole again.
    """
    frames: list[Painted] = []
    for k in range(4 * rate):
        time_s = k / rate
        left = 10 + 40 * time_s
        head, legs = (left, 20, 20, 40), (left, 64, 20, 30)
        seen = [legs] if 1.6 <= time_s < 2.8 else [head, legs] if 2.8 <= time_s < 3.1 else []
        frames.append([(part, RED) for part in seen or [(left, 20, 20, 74)]])
    return frames


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_a_person_seen_in_parts_behind_a_sign_is_one_track_afterwards(rate: int):
    found = tracked(behind_a_sign(rate), rate)
    for tracks in found[math.ceil(3.1 * rate) :]:
        assert [track.id for track in tracks] == [1]
        assert tracks[0].box[3] == pytest.approx(74, abs=6)


def behind_a_pillar(rate: int, height: int, color: tuple[int, int, int]) -> list[Painted]:
    """Return 4 s of a red object, 60 high, that is hidden for 0.5 s; another may come out."""
    frames: list[Painted] = []
    for k in range(4 * rate):
        left = 20 + 60 * k / rate
        before, after = min(left + 30, 110) - left, left + 30 - max(left, 170)
        parts = [((left, 20, before, 60), RED), ((left + 30 - after, 20, after, height), color)]
        frames.append([(box, bgr) for box, bgr in parts if box[2] >= 1])
    return frames


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_an_object_that_was_hidden_by_a_pillar_is_the_same_when_it_comes_out_bit_by_bit(rate: int):
    found = tracked(behind_a_pillar(rate, 60, RED), rate)
    assert {track.id for track in found[rate]} == {1}
    assert [(track.id, track.state) for track in found[-1]] == [(1, "confirmed")]


@pytest.mark.parametrize("rate", [30, 10])
@pytest.mark.parametrize(
    ("height", "color"),
    [pytest.param(60, BLUE, id="another colour"), pytest.param(30, RED, id="half as high")],
)
def test_another_object_that_comes_out_from_behind_the_pillar_gets_an_id_of_its_own(
    height: int, color: tuple[int, int, int], rate: int
):
    found = tracked(behind_a_pillar(rate, height, color), rate)
    assert [(track.id, track.state) for track in found[-1]] == [(2, "confirmed")]


def test_one_that_waits_where_another_is_expected_is_not_the_other():
    frames: list[Painted] = []
    for k in range(60):  # at 20 Hz; the first one vanishes at 80
        walking = [((20 + 3 * k, 20, 20, 60), RED)] if k < 20 else []
        frames.append([*walking, ((150, 20, 20, 60), RED)])
    found = tracked(frames)
    assert [(track.id, track.state) for track in found[-1]] == [(1, "lost"), (2, "tentative")]


@pytest.mark.parametrize("rate", [20, 10, 5])
def test_one_whose_legs_become_hidden_does_not_seem_to_rise(rate: int):
    frames: list[Painted] = []
    for k in range(2 * rate):
        height = 80 if k <= 1.5 * rate else 38  # then a wall hides the rest
        frames.append([((10 + 80 * k / rate, 20, 24, height), RED)])
    found = tracked(frames, rate)
    assert max(abs(tracks[0].vy) for tracks in found) < 10


def test_what_appears_where_pixels_keep_changing_is_confirmed_where_they_do_not():
    tracker, states = Tracker(TrackingParameters(), SIZE), []
    changes = np.zeros(SIZE[::-1], np.uint8)
    changes[:, :150] = 40
    for k in range(20):
        left = 60 + 6 * k
        mask = np.zeros(SIZE[::-1], np.uint8)
        mask[40:80, left : left + 20] = 255
        scene = Scene(np.full((SIZE[1], SIZE[0], 3), 120, np.uint8), mask, changes)
        tracks = tracker.update([Fragment(left, 40, left + 20, 80, 800)], k * SECOND // 10, scene)
        states.append(tracks[0].state)
    # From 138 to 158 the mean is 24; the distance of 78 is less than three sides.
    assert states == ["tentative"] * 13 + ["confirmed"] * 7


def crossed(sway: float, changes: int, counted_s: float = math.inf) -> set[str]:
    """Return the states of an object that crosses 190 pixels, more than six of its sides."""
    tracker, states = Tracker(TrackingParameters(), SIZE), set()
    for k in range(20):
        left = 30 + 10 * k + sway * (-1) ** k
        mask = np.zeros(SIZE[::-1], np.uint8)
        mask[40:80, round(left) : round(left) + 20] = 255
        picture = np.full((SIZE[1], SIZE[0], 3), 120, np.uint8)
        scene = Scene(picture, mask, np.full_like(mask, changes), counted_s)
        fragment = Fragment(left, 40, left + 20, 80, 800)
        states |= {track.state for track in tracker.update([fragment], k * SECOND // 10, scene)}
    return states


def test_where_pixels_keep_changing_a_long_way_is_that_of_an_object_if_it_is_steady():
    assert crossed(sway=0, changes=200) == {"tentative", "confirmed"}
    assert crossed(sway=4, changes=200) == {"tentative"}  # 0.14 of the side
    assert crossed(sway=4, changes=10) == {"tentative", "confirmed"}


def test_changes_are_many_by_the_time_in_which_they_were_counted():
    jumping, second = 4, 1.0
    assert crossed(jumping, 10, counted_s=second) == {"tentative"}
    assert crossed(jumping, 10, counted_s=2 * second) == {"tentative", "confirmed"}


def test_a_track_that_a_frame_does_not_show_is_not_confirmed_by_it():
    tracker = Tracker(TrackingParameters(), SIZE)
    for k in range(4):
        left = 20 + 10 * k
        tracker.update([Fragment(left, 40, left + 20, 80, 800)], k * SECOND // 10)
    (track,) = tracker.update([], 4 * SECOND // 10)
    assert track.state == "tentative"
    (track,) = tracker.update([Fragment(70, 40, 90, 80, 800)], 5 * SECOND // 10)
    assert track.state == "confirmed"


@pytest.mark.parametrize("rate", [30, 10])
def test_becoming_whole_again_is_not_a_motion_of_the_steady_point(rate: int):
    found = tracked(behind_a_sign(rate), rate)
    points = [tracks[0].steady for tracks in found[math.ceil(2.8 * rate) - 2 :]]
    jumps = [abs(b[1] - a[1]) for a, b in pairwise(each for each in points if each is not None)]
    assert max(jumps) < 4
