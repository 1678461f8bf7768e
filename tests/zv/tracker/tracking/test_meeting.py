"""Tracks of objects that meet, with pixels: one hides the other, or parts of one are connected."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import pytest

from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.track import Track
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

SIZE = (300, 120)  # width, height
RED, BLUE = (20, 20, 200), (200, 60, 20)
EMPTY = Scene(np.zeros((SIZE[1], SIZE[0], 3), np.uint8), np.zeros(SIZE[::-1], np.uint8))
Box = tuple[float, float, float, float]  # left, top, width, height
Painted = Sequence[tuple[Box, tuple[int, int, int]]]


def step(
    tracker: Tracker, regions: Sequence[Region], now_s: float, scene: Scene = EMPTY
) -> list[Track]:
    tracker.predict(now_s)
    return tracker.update(regions, scene)


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
        regions = [
            Region(x, y, x + w, y + h, cv2.countNonZero(mask[y : y + h, x : x + w]))
            for x, y, w, h in regions
        ]
        found.append(step(tracker, regions, k / rate, Scene(picture, mask)))
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
def test_an_object_that_enters_is_confirmed_when_its_edge_has_moved_by_its_width(rate: int):
    # It is inside after 0.9 s, and its edge has moved by its width of 60 pixels after 1 s.
    frames: list[Painted] = [[((-54 + 60 * k / rate, 20, 60, 90), RED)] for k in range(2 * rate)]
    states = [tracks[0].state for tracks in tracked(frames, rate)]
    assert 0.9 <= states.index("confirmed") / rate <= 1.4


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


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_a_head_apart_from_its_body_at_first_is_a_part_when_they_stay_together(rate: int):
    frames: list[Painted] = []
    for k in range(7 * rate):
        left = 10 + 30 * k / rate
        apart = 4 if k < rate else 0
        head, body = (left + 5, 16, 10, 24 - apart), (left, 40 + apart, 20, 50)
        frames.append([(part, RED) for part in (head, body)])
    found = tracked(frames, rate)
    assert [track.state for track in found[-1]] == ["confirmed"]
    assert found[-1][0].box[1] == pytest.approx(16, abs=2)
    assert found[-1][0].box[3] == pytest.approx(74, abs=4)


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_two_who_were_seen_apart_stay_two_while_they_walk_side_by_side(rate: int):
    frames: list[Painted] = []
    for k in range(7 * rate):
        time_s = k / rate
        apart = max(0, 30 - 15 * time_s)  # they touch after 2 s
        frames.append(
            [((60 + 20 * time_s - apart, 20, 24, 80), RED), ((84 + 20 * time_s, 20, 24, 80), BLUE)]
        )
    assert [track.state for track in tracked(frames, rate)[-1]] == ["confirmed"] * 2


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


def behind_a_pillar(rate: int) -> list[Painted]:
    """Return 4 s of an object that is hidden for 0.5 s."""
    frames: list[Painted] = []
    for k in range(4 * rate):
        left = 20 + 60 * k / rate
        before, after = min(left + 30, 110) - left, left + 30 - max(left, 170)
        parts = [((left, 20, before, 60), RED), ((left + 30 - after, 20, after, 60), RED)]
        frames.append([(box, bgr) for box, bgr in parts if box[2] >= 1])
    return frames


@pytest.mark.parametrize("rate", [30, 10, 5])
def test_an_object_that_was_hidden_by_a_pillar_is_the_same_when_it_comes_out_bit_by_bit(rate: int):
    found = tracked(behind_a_pillar(rate), rate)
    assert {track.id for track in found[rate]} == {1}
    assert [(track.id, track.state) for track in found[-1]] == [(1, "confirmed")]


def test_one_that_waits_where_another_is_expected_is_not_the_other():
    frames: list[Painted] = []
    for k in range(60):  # at 20 Hz; the first one vanishes at 80
        walking = [((20 + 3 * k, 20, 20, 60), RED)] if k < 20 else []
        frames.append([*walking, ((150, 20, 20, 60), RED)])
    found = tracked(frames)
    assert sorted(track.state for track in found[-1]) == ["lost", "tentative"]


@pytest.mark.parametrize("rate", [20, 10, 5])
def test_one_whose_legs_become_hidden_does_not_seem_to_rise(rate: int):
    frames: list[Painted] = []
    for k in range(2 * rate):
        height = 80 if k <= 1.5 * rate else 38  # then a wall hides the rest
        frames.append([((10 + 80 * k / rate, 20, 24, height), RED)])
    found = tracked(frames, rate)
    assert max(abs(tracks[0].vy) for tracks in found) < 10


def test_a_track_that_a_frame_does_not_show_is_not_confirmed_by_it():
    tracker = Tracker(TrackingParameters(), SIZE)
    for k in range(6):
        left = 20 + 5 * k
        step(tracker, [Region(left, 40, left + 20, 80, 800)], k / 20)
    (track,) = step(tracker, [], 0.3)
    assert track.state == "tentative"
    (track,) = step(tracker, [Region(55, 40, 75, 80, 800)], 0.35)
    assert track.state == "confirmed"


def test_an_object_that_shared_a_region_keeps_its_size_while_part_of_it_is_hidden():
    whole, half = Region(80, 20, 110, 100, 2400), Region(80, 20, 98, 100, 1440)
    tracker = Tracker(TrackingParameters(), SIZE)
    scene = Scene(EMPTY.picture, np.full(SIZE[::-1], 255, np.uint8))
    for k in range(20):  # the other one comes from the right and stops before a part of it
        other = Region(max(98, 212 - 6 * k), 20, max(98, 212 - 6 * k) + 30, 100, 2400)
        regions = [whole, other] if other.left > 112 else [Region(80, 20, other.right, 100, 4800)]
        step(tracker, regions, k / 10, scene)
    for k in range(20, 30):
        step(tracker, [half, Region(99, 20, 129, 100, 2400)], k / 10, scene)
    assert len(tracker.states) == 2
    assert tracker.states[0].width == pytest.approx(30, abs=2)
