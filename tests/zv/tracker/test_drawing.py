"""Drawing into ``tracked``: boxes in the colours of their ids, and trails."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from tests.support.track_walks import track
from zv.tracker.drawing import LOST_COLOR, Trails, color_of, draw_tracks

FRAME = np.full((120, 160, 3), 50, np.uint8)


def test_the_colours_of_a_dozen_ids_in_a_row_differ():
    """By 50 of 255 in a channel: 13 degrees of hue; two ids that differ by 8 are the nearest."""
    for first in (1, 30, 1000):
        colors = [np.array(color_of(first + number)) for number in range(12)]
        assert min(np.abs(a - b).max() for a, b in combinations(colors, 2)) > 50


def test_confirmed_and_lost_tracks_are_drawn_and_tentative_ones_are_not():
    tracks = [
        track(30, 60, id_=1),
        track(80, 60, id_=2, state="lost", missing_s=0.1),
        track(130, 60, id_=3, state="tentative"),
    ]
    before = FRAME.copy()
    drawn = draw_tracks(FRAME, tracks, {})
    assert np.array_equal(FRAME, before)
    # The box of 20 x 20 around (30, 60) begins at x = 20.
    assert tuple(drawn[65, 20]) == color_of(1)
    assert tuple(drawn[65, 70]) == LOST_COLOR
    assert (drawn[:, 105:] == 50).all()


def test_without_tracks_to_draw_the_result_is_the_frame_itself():
    assert draw_tracks(FRAME, [track(130, 60, state="tentative")], {}) is FRAME


def test_a_trail_has_the_seen_positions_of_the_last_three_seconds():
    trails = Trails()
    for second in range(5):
        seen = second != 3
        state = "confirmed" if seen else "lost"
        found = track(10 * second, 5, state=state, missing_s=0.0 if seen else 1.0)
        trails.update([found], second * 10**9)
    assert trails.lines() == {1: [(10, 5), (20, 5), (40, 5)]}
    trails.update([track(90, 5, id_=2)], 5 * 10**9)
    assert trails.lines() == {2: [(90, 5)]}
