"""Tracks from boxes alone: lifetimes, ids, time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.base import MAX_TRACKS
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.track import Track
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

SIZE = (400, 300)


def box(x: float, y: float, width: float = 20, height: float = 40) -> Region:
    """Return a region around a middle."""
    return Region(
        x - width / 2, y - height / 2, x + width / 2, y + height / 2, width * height * 0.7
    )


def step(found: Tracker, regions: Sequence[Region], now_s: float) -> list[Track]:
    """Track the regions of a frame in which all objects have one colour."""
    mask = np.zeros(SIZE[::-1], np.uint8)
    for region in regions:
        left, top, right, bottom = (max(0, round(edge)) for edge in region[:4])
        mask[top:bottom, left:right] = 255
    found.predict(now_s)
    return found.update(regions, Scene(np.zeros((*SIZE[::-1], 3), np.uint8), mask))


def tracker(**changes: Any) -> Tracker:
    return Tracker(TrackingParameters(**changes), SIZE)


def test_a_moving_object_is_confirmed_with_its_velocity_and_keeps_its_id():
    found = tracker()
    for k in range(30):
        tracks = step(found, [box(50 + 6 * k, 100)], k / 10)
    (track,) = tracks
    assert (track.id, track.state) == (1, "confirmed")
    assert track.x == pytest.approx(50 + 6 * 29, abs=1)
    assert (track.vx, track.vy) == (pytest.approx(60, abs=2), pytest.approx(0, abs=1))
    assert track.age_s == pytest.approx(2.9)
    assert track.missing_s == 0


def test_an_entering_object_has_the_velocity_of_its_front_edge():
    found, steady = tracker(), []
    for k in range(6):  # 20 pixels wide; from k = 4 on it is inside
        front = 6.0 * (k + 1)
        left = max(0.0, front - 20)
        (track,) = step(found, [Region(left, 80, front, 120, 500)], k / 10)
        steady.append((track.steady or (0.0, 0.0))[0])
    assert np.diff(steady[1:]) == pytest.approx([6] * 4)
    assert track.vx == pytest.approx(60, abs=6)
    assert steady[-1] + track.offset[0] == pytest.approx(26)


def test_noise_at_an_edge_hardly_moves_an_object_of_many_pixels():
    found, steady = tracker(), []
    for k in range(12):
        x = 50 + 6.0 * k
        shaken = Region(x - 10, 80, x + 10 + 4 * (k % 2), 120, 500, (x, 100))
        (track,) = step(found, [shaken], k / 10)
        steady.append((track.steady or (0.0, 0.0))[0])
    assert np.diff(steady[1:]) == pytest.approx([6] * 10)
    assert track.x == pytest.approx(x + 1, abs=0.5)  # the middle is that of the mean box


def test_an_object_that_does_not_move_or_only_grows_is_never_confirmed():
    standing, growing = tracker(), tracker()
    for k in range(100):
        (still,) = step(standing, [box(100, 100)], k / 10)
        (grown,) = step(growing, [Region(50, 50, 70 + k, 90, 500)], k / 10)
        assert (still.state, grown.state) == ("tentative", "tentative")


def test_an_object_that_comes_nearer_is_confirmed():
    """Its feet move four times as far as its head, since it grows."""
    found = tracker()
    for k in range(40):
        head, feet, half = 50 + 0.5 * k, 90 + 2 * k, 10 + 0.3 * k
        (track,) = step(found, [Region(200 - half, head, 200 + half, feet, 500)], k / 10)
    assert track.state == "confirmed"


def test_a_strip_along_the_border_that_shrinks_and_breaks_is_never_confirmed():
    """Where light has changed along a border, the last of it is small, and at any place of it."""
    found = tracker()
    for k in range(60):
        height, left = max(4, 24 - k), 6 * max(0, k - 20)
        tracks = step(found, [Region(left, 0, 400, height, 300 * height)], k / 30)
        assert [track.state for track in tracks] == ["tentative"]


@pytest.mark.parametrize(("height", "state"), [(40, "confirmed"), (30, "tentative")])
def test_what_has_become_smaller_than_the_least_area_is_not_confirmed(height: int, state: str):
    found = tracker(min_area=500)  # 70 % of 20x40 are 560, of 20x30 they are 420
    for k in range(20):
        tracks = step(found, [box(50 + 6 * k, 100, height=height if k else 40)], k / 10)
    assert [track.state for track in tracks] == [state]


def test_an_object_of_which_less_than_the_least_area_shows_is_lost_for_so_long_and_followed():
    found, states = tracker(min_area=500), []
    for k in range(40):
        (track,) = step(found, [box(50 + 6 * k, 100, height=25 if 20 <= k < 30 else 40)], k / 10)
        states.append(track.state)
        assert track.id == 1
    assert (set(states[10:20]), set(states[20:30]), set(states[30:])) == (
        {"confirmed"},
        {"lost"},
        {"confirmed"},
    )


@pytest.mark.parametrize("rate", [5, 10, 30])
def test_what_is_seen_in_two_of_three_frames_is_never_confirmed(rate: int):
    found = tracker()
    for k in range(4 * rate):
        regions = [box(50 + 20 * k / rate, 100)] if k % 3 else []  # 2.8 sides in all
        tracks = step(found, regions, k / rate)
        assert {track.state for track in tracks} <= {"tentative"}
    assert tracks


@pytest.mark.parametrize("rate", [5, 10, 30])
def test_the_frame_rate_changes_neither_ids_nor_lifetimes(rate: int):
    found = tracker()
    confirmed_s = lost_s = ended_s = None
    for k in range(6 * rate):
        now_s = k / rate
        regions = [box(50 + 60 * now_s, 100)] if now_s < 3 else []
        tracks = step(found, regions, now_s)
        states = [track.state for track in tracks]
        if confirmed_s is None and states == ["confirmed"]:
            confirmed_s = now_s
        if lost_s is None and states == ["lost"]:
            lost_s = now_s
        if now_s > 3 and ended_s is None and not states:
            ended_s = now_s
    assert found.next_id == 2
    period = 1 / rate
    assert confirmed_s == pytest.approx(0.4, abs=max(0.1, period) + 0.15)
    assert lost_s == 3.0  # the first frame in which it is not seen
    assert ended_s == pytest.approx(5.0, abs=period + 0.05)


def test_a_pause_and_dropped_frames_keep_the_track():
    found = tracker()
    kept = set(range(20)) | {25, 26, 31, 33, 34, 36, 39}
    for k in sorted(kept):
        tracks = step(found, [box(50 + 6 * k, 100)], k / 10)
    assert [track.id for track in tracks] == [1]


def test_the_id_of_an_ended_track_is_not_reused():
    found = tracker(keep_lost_s=0.5)
    ids = set()
    for k in range(90):
        regions = [] if k % 30 > 15 else [box(50 + 6 * (k % 30), 100)]
        ids |= {track.id for track in step(found, regions, k / 10)}
    assert ids == {1, 2, 3}


def test_time_that_does_not_pass_ages_nothing():
    found = tracker()
    for k in range(10):
        step(found, [box(50 + 6 * k, 100)], k / 10)
    for _ in range(50):
        (track,) = step(found, [], 0.9)
    assert (track.state, track.missing_s) == ("confirmed", 0.0)
    (track,) = step(found, [box(110, 100)], 1.0)
    assert (track.id, track.age_s) == (1, pytest.approx(1.0))


@pytest.mark.parametrize("step_s", [0.0, 1e-6])
def test_a_thousand_frames_in_no_time_give_finite_tracks(step_s: float):
    found = tracker()
    for k in range(2000):
        tracks = step(found, [box(100 + 3 * (k % 40), 100)], k * step_s)
    assert all(np.isfinite([track.x, track.y, track.vx, track.vy]).all() for track in tracks)


def test_the_same_input_gives_the_same_tracks():
    def results() -> list[object]:
        random = np.random.default_rng(7)
        found = tracker()
        return [
            step(
                found,
                [box(*random.uniform(20, 280, 2)) for _ in range(random.integers(0, 9))],
                k / 10,
            )
            for k in range(40)
        ]

    assert results() == results()


def test_crossing_objects_keep_their_ids_by_their_motion_if_they_look_the_same():
    found = tracker()
    for k in range(60):
        one, two = box(50 + 5 * k, 100), box(345 - 5 * k, 104)
        if abs(one.center[0] - two.center[0]) < 20:
            regions = [
                Region(min(one.left, two.left), 80, max(one.right, two.right), 124, one.area * 1.4)
            ]
        else:
            regions = [one, two]
        tracks = step(found, regions, k / 10)
    assert {track.id: round(track.vx / 50) for track in tracks} == {1: 1, 2: -1}


def test_two_objects_that_entered_as_one_become_two_tracks_at_a_gap():
    found = tracker()
    for k in range(30):
        x = 60 + 5 * k
        if k < 10:
            regions = [Region(x - 22, 80, x + 22, 120, 1100)]
        else:
            regions = [box(x - 12, 100), box(x + 12, 100)]
        tracks = step(found, regions, k / 10)
    assert [track.state for track in tracks] == ["confirmed", "confirmed"]
    assert sorted(round(track.x) for track in tracks) == pytest.approx([193, 217], abs=3)


def test_a_bounded_number_of_thousands_of_regions_is_tracked():
    found = tracker()
    crowd = [box(10 + 8 * (k % 45), 10 + 6 * (k // 45), 5, 4) for k in range(2000)]
    found.parameters = TrackingParameters(min_area=1)
    for k in range(2):
        tracks = step(found, crowd, k / 10)
    assert len(tracks) <= MAX_TRACKS


def test_an_hour_without_objects_gives_no_tracks():
    found = tracker()
    assert all(step(found, [], float(k)) == [] for k in range(3600))


def test_each_region_is_an_object_if_all_are_convex():
    found = tracker(convex=True)
    for k in range(20):
        upper, lower = box(50 + 6 * k, 100, 30, 20), box(52 + 6 * k, 121, 30, 20)
        together = box(51 + 6 * k, 110, 32, 41)
        tracks = step(found, [upper, lower] if k > 3 else [together], k / 10)
    assert [track.state for track in tracks] == ["confirmed"] * 2
    assert sorted(track.y for track in tracks) == pytest.approx([100, 121], abs=1)
