"""Drawing into ``tracked``: boxes in the colours of their ids, and trails."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from tests.support.track_walks import track
from zv.tracker.drawing import LOST_COLOR, color_of, draw_tracks

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


@pytest.mark.parametrize(("trail_x", "shift"), [(80, (0, 0)), (74, (6, -5))])
def test_a_trail_is_drawn_through_earlier_centres_where_the_frame_shows_them(
    trail_x: int, shift: tuple[int, int]
):
    trail = [(trail_x + 0.4, 20), (trail_x - 0.4, 60)]
    drawn = draw_tracks(FRAME, [track(80, 100, id_=2)], {2: trail}, shift)
    assert (drawn[25:55, 80] == color_of(2)).all()
    assert (drawn[:, 120:] == 50).all()
