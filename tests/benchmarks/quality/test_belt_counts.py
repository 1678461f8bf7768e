"""Counting on the belt tells right from missed and double, on paths that are known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.quality.tracker.belt import LINE_MM, Crossing, border_boxes, counts, crossings_of
from tests.support.pictures.belt import Belt

BELT = Belt(320, 240, number=12, noise=0)


def path_of(object_id: int, times: list[float]) -> list[tuple[float, float, float]]:
    """Return time, x, y in pixels of an object's true centre."""
    mm = [[belt.x_mm, belt.y_mm] for t in times for belt in [BELT.positions(t)[object_id - 1]]]
    return [(t, x, y) for t, (x, y) in zip(times, BELT.to_pixels(np.array(mm)), strict=True)]


def test_a_path_crosses_at_the_true_time_even_if_it_jumps_over_the_line():
    true_s = BELT.crossing_s(4, LINE_MM)
    for times in ([true_s - 0.05, true_s + 0.05], [true_s - 1.0, true_s + 0.3]):
        (found,) = crossings_of(BELT, {7: path_of(4, times)})
        # The path is straight and steady on the belt, so that the interpolation is exact there.
        assert found.time_s == pytest.approx(true_s, abs=1e-6)
        assert found.y_mm == pytest.approx(BELT.objects[3].y_mm, abs=1e-6)


def test_a_path_that_ends_before_the_line_crosses_nothing():
    true_s = BELT.crossing_s(4, LINE_MM)
    assert crossings_of(BELT, {7: path_of(4, [true_s - 1, true_s - 0.1])}) == []


def truth() -> list[Crossing]:
    return [Crossing(BELT.crossing_s(one.id, LINE_MM), one.y_mm) for one in BELT.objects]


def test_all_objects_crossing_once_are_counted_once():
    found = counts(BELT, [Crossing(one.time_s + 0.02, one.y_mm + 2) for one in truth()])
    assert (found.objects, found.once, found.missed, found.extra) == (12, 12, 0, 0)
    assert (found.in_pairs, found.pairs_once) == (4, 4)
    assert found.error_ms == pytest.approx(20)


def test_one_crossing_for_a_touching_pair_leaves_one_object_missed():
    whole = truth()
    first = next(one for one in BELT.objects if one.touches is not None)
    other = first.touches - 1
    merged = Crossing(
        (whole[first.id - 1].time_s + whole[other].time_s) / 2,
        (whole[first.id - 1].y_mm + whole[other].y_mm) / 2,
    )
    rest = [one for index, one in enumerate(whole) if index not in (first.id - 1, other)]
    found = counts(BELT, [*rest, merged])
    assert (found.once, found.missed, found.extra, found.pairs_once) == (11, 1, 0, 3)


def test_an_object_that_is_counted_twice_is_not_counted_once():
    whole = truth()
    found = counts(BELT, [*whole, Crossing(whole[5].time_s + 0.1, whole[5].y_mm)])
    assert (found.once, found.missed, found.extra) == (11, 0, 1)


def test_a_crossing_where_no_object_is_counts_as_extra_only():
    found = counts(BELT, [*truth(), Crossing(0.1, 200.0)])
    assert (found.once, found.missed, found.extra) == (12, 0, 1)
    assert counts(BELT, []).missed == 12


def test_objects_at_the_border_are_ignored_and_never_in_the_truth_too():
    times = np.arange(0, BELT.duration_s, 0.5)
    cut = 0
    for time_s in times:
        whole = BELT.boxes(time_s)
        border = border_boxes(BELT, time_s, whole)
        cut += len(border)
        for x, y, width, height in border:
            edges = (x, y, BELT.width - x - width, BELT.height - y - height)
            assert min(edges) == pytest.approx(0, abs=1.01)
    assert cut >= 12
