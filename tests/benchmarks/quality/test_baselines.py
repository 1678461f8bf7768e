"""The baselines do what their papers say, on boxes whose outcome can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.quality.tracker.baselines import ByteTrack, Detection, Sort, assigned


def at(x: float, score: float = 0.9) -> Detection:
    return Detection((x, 100.0, 40.0, 80.0), score)


def test_the_assignment_maximises_the_sum_and_not_the_first_choice():
    # Greedily row 0 would take column 0 (0.9), and leave row 1 with 0.1: together less than 1.5.
    gain = np.array([[0.9, 0.8], [0.7, 0.1]])
    assert assigned(gain, 0.3) == [(0, 1), (1, 0)]
    assert assigned(gain, 0.75) == [(0, 1)]
    assert assigned(np.zeros((0, 2)), 0.3) == []


def test_sort_keeps_the_id_of_a_box_that_moves_steadily():
    sort = Sort()
    # 15 pixels a frame: the overlap of neighbours, 25 / 55, is above 0.3.
    found = [sort.update([at(15.0 * index)]) for index in range(8)]
    assert [set(boxes) for boxes in found] == [{1}] * 8
    assert found[7][1] == pytest.approx((105, 100, 40, 80), abs=2)


def test_sort_shows_a_later_box_after_three_hits_in_a_row_following_the_first():
    sort = Sort()
    for _ in range(5):
        sort.update([])
    shown = [bool(sort.update([at(10)])) for _ in range(5)]
    # The first sight creates the track, which has no hit yet; the fourth is its third hit.
    assert shown == [False, False, False, True, True]


def test_sort_forgets_a_box_after_one_frame_without():
    sort = Sort()
    for _ in range(4):
        sort.update([at(10)])
    assert sort.update([]) == {}
    assert set(sort.update([at(10)])) == set()  # the row of hits begins again
    sort.update([])
    sort.update([])
    ids = [set(sort.update([at(10)])) for _ in range(4)]
    assert ids[-1] == {2}


def test_sort_switches_when_a_box_jumps_further_than_its_overlap():
    sort = Sort()
    for _ in range(4):
        assert set(sort.update([at(10)])) == {1}
    for _ in range(4):
        found = sort.update([at(60)])  # no overlap with 10 to 50
    assert set(found) == {2}


def test_bytetrack_follows_a_box_whose_score_falls_and_sort_with_a_threshold_would_not():
    tracker = ByteTrack()
    for index in range(4):
        assert set(tracker.update([at(10 + 2 * index)])) == {1}
    for index in range(4, 8):
        assert set(tracker.update([at(10 + 2 * index, score=0.2)])) == {1}
    assert tracker.update([at(26, score=0.05)]) == {}


def test_bytetrack_shows_a_later_box_when_it_is_seen_twice_and_never_for_low_scores():
    tracker = ByteTrack()
    tracker.update([])
    assert [bool(tracker.update([at(10)])) for _ in range(2)] == [False, True]
    tracker = ByteTrack()
    assert [tracker.update([at(10, score=0.2)]) for _ in range(3)] == [{}] * 3


def test_bytetrack_finds_a_box_again_within_thirty_frames():
    tracker = ByteTrack()
    for _ in range(4):
        tracker.update([at(10)])
    for _ in range(29):
        assert tracker.update([]) == {}
    assert set(tracker.update([at(10)])) == {1}
    for _ in range(31):
        tracker.update([])
    assert set(tracker.update([at(10)])) == set()
