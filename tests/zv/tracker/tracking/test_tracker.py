"""Tracks from boxes alone: lifetimes, ids, time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.target import MOST_PLACES
from zv.tracker.tracking.targets import MAX_TARGETS
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

SIZE = (400, 300)
SECOND = 1_000_000_000


def box(x: float, y: float, width: float = 20, height: float = 40) -> Fragment:
    """Return a fragment around a middle."""
    return Fragment(
        x - width / 2, y - height / 2, x + width / 2, y + height / 2, width * height * 0.7
    )


def tracker(**changes: Any) -> Tracker:
    return Tracker(TrackingParameters(**changes), SIZE)


def test_a_moving_object_is_confirmed_with_its_velocity_and_keeps_its_id():
    found = tracker()
    for k in range(30):
        tracks = found.update([box(50 + 6 * k, 100)], k * SECOND // 10)
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
        (track,) = found.update([Fragment(left, 80, front, 120, 500)], k * SECOND // 10)
        steady.append((track.steady or (0.0, 0.0))[0])
    assert np.diff(steady[1:]) == pytest.approx([6] * 4)
    assert track.vx == pytest.approx(60, abs=6)
    assert steady[-1] + track.offset[0] == pytest.approx(26)


def test_noise_at_an_edge_hardly_moves_an_object_of_many_pixels():
    found, steady = tracker(), []
    for k in range(12):
        x = 50 + 6.0 * k
        shaken = Fragment(x - 10, 80, x + 10 + 4 * (k % 2), 120, 500, (x, 100))
        (track,) = found.update([shaken], k * SECOND // 10)
        steady.append((track.steady or (0.0, 0.0))[0])
    assert np.diff(steady[1:]) == pytest.approx([6] * 10)
    assert track.x == pytest.approx(x + 1, abs=0.5)  # the middle is that of the mean box


def test_an_object_that_does_not_move_or_only_grows_is_never_confirmed():
    standing, growing = tracker(), tracker()
    for k in range(100):
        (still,) = standing.update([box(100, 100)], k * SECOND // 10)
        (grown,) = growing.update([Fragment(50, 50, 70 + k, 90, 500)], k * SECOND // 10)
        assert (still.state, grown.state) == ("tentative", "tentative")


@pytest.mark.parametrize("rate", [5, 10, 30])
def test_what_is_seen_in_two_of_three_frames_is_never_confirmed(rate: int):
    found = tracker()
    for k in range(4 * rate):
        fragments = [box(50 + 20 * k / rate, 100)] if k % 3 else []  # 2.8 sides in all
        tracks = found.update(fragments, k * SECOND // rate)
        assert {track.state for track in tracks} <= {"tentative"}
    assert tracks


@pytest.mark.parametrize("rate", [5, 10, 30])
def test_the_frame_rate_changes_neither_ids_nor_lifetimes(rate: int):
    found = tracker()
    confirmed_s = lost_s = ended_s = None
    for k in range(6 * rate):
        now_s = k / rate
        fragments = [box(50 + 60 * now_s, 100)] if now_s < 3 else []
        tracks = found.update(fragments, int(now_s * SECOND))
        states = [track.state for track in tracks]
        if confirmed_s is None and states == ["confirmed"]:
            confirmed_s = now_s
        if now_s > 3 and lost_s is None and states == ["lost"]:
            lost_s = now_s
        if now_s > 3 and ended_s is None and not states:
            ended_s = now_s
    assert found.next_id == 2
    step = 1 / rate
    assert confirmed_s == pytest.approx(0.4, abs=max(0.1, step) + 0.15)
    assert lost_s == pytest.approx(3.3, abs=step + 0.05)
    assert ended_s == pytest.approx(5.0, abs=step + 0.05)


def test_a_pause_and_dropped_frames_keep_the_track():
    found = tracker()
    kept = set(range(20)) | {25, 26, 31, 33, 34, 36, 39}
    for k in sorted(kept):
        tracks = found.update([box(50 + 6 * k, 100)], k * SECOND // 10)
    assert [track.id for track in tracks] == [1]


def test_the_id_of_an_ended_track_is_not_reused():
    found = tracker(keep_lost_s=0.5)
    ids = set()
    for k in range(90):
        fragments = [] if k % 30 > 15 else [box(50 + 6 * (k % 30), 100)]
        ids |= {track.id for track in found.update(fragments, k * SECOND // 10)}
    assert ids == {1, 2, 3}


def test_repeated_stamps_age_nothing_and_after_an_earlier_stamp_time_continues():
    found = tracker()
    for k in range(10):
        found.update([box(50 + 6 * k, 100)], k * SECOND // 10)
    for _ in range(50):
        (track,) = found.update([], 9 * SECOND // 10)
    assert (track.state, track.missing_s) == ("confirmed", 0.0)
    (track,) = found.update([box(110, 100)], 0)
    assert (track.id, track.age_s) == (1, pytest.approx(0.9))
    (track,) = found.update([box(116, 100)], SECOND // 10)
    assert (track.id, track.age_s) == (1, pytest.approx(1.0))


@pytest.mark.parametrize("step_ns", [0, 1000])
def test_a_thousand_frames_in_no_time_give_finite_tracks_in_bounded_memory(step_ns: int):
    found = tracker(confirm_sides=1000.0)  # its path is kept, as it is never confirmed
    for k in range(2000):
        tracks = found.update([box(100 + 3 * (k % 40), 100)], k * step_ns)
    assert all(np.isfinite([track.x, track.y, track.vx, track.vy]).all() for track in tracks)
    assert max(len(target.path) for target in found.targets) <= MOST_PLACES


def test_the_same_input_gives_the_same_tracks():
    def results() -> list[object]:
        random = np.random.default_rng(7)
        found = tracker()
        return [
            found.update(
                [box(*random.uniform(20, 280, 2)) for _ in range(random.integers(0, 9))],
                k * SECOND // 10,
            )
            for k in range(40)
        ]

    assert results() == results()


def test_crossing_objects_keep_their_ids_by_their_motion_if_no_pixels_are_given():
    found = tracker()
    for k in range(60):
        one, two = box(50 + 5 * k, 100), box(345 - 5 * k, 104)
        if abs(one.center[0] - two.center[0]) < 20:
            fragments = [
                Fragment(
                    min(one.left, two.left), 80, max(one.right, two.right), 124, one.area * 1.4
                )
            ]
        else:
            fragments = [one, two]
        tracks = found.update(fragments, k * SECOND // 10)
    assert {track.id: round(track.vx / 50) for track in tracks} == {1: 1, 2: -1}


def test_two_objects_that_entered_as_one_become_two_tracks_at_a_gap():
    found = tracker()
    for k in range(30):
        x = 60 + 5 * k
        if k < 10:
            fragments = [Fragment(x - 22, 80, x + 22, 120, 1100)]
        else:
            fragments = [box(x - 12, 100), box(x + 12, 100)]
        tracks = found.update(fragments, k * SECOND // 10)
    assert [track.state for track in tracks] == ["confirmed", "confirmed"]
    assert sorted(round(track.x) for track in tracks) == pytest.approx([193, 217], abs=3)


def test_a_bounded_number_of_thousands_of_fragments_is_tracked():
    found = tracker()
    crowd = [box(10 + 8 * (k % 45), 10 + 6 * (k // 45), 5, 4) for k in range(2000)]
    found.parameters = TrackingParameters(min_area=1)
    for k in range(2):
        tracks = found.update(crowd, k * SECOND // 10)
    assert len(tracks) <= MAX_TARGETS


def test_an_hour_without_objects_gives_no_tracks():
    found = tracker()
    assert all(found.update([], k * SECOND) == [] for k in range(3600))


def test_each_fragment_is_an_object_if_all_are_convex():
    found = tracker(convex=True)
    for k in range(20):
        upper, lower = box(50 + 6 * k, 100, 30, 20), box(52 + 6 * k, 121, 30, 20)
        together = box(51 + 6 * k, 110, 32, 41)
        tracks = found.update([upper, lower] if k > 3 else [together], k * SECOND // 10)
    assert [track.state for track in tracks] == ["confirmed"] * 2
    assert sorted(track.y for track in tracks) == pytest.approx([100, 121], abs=1)
