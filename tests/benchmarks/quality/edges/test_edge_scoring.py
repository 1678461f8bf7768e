"""The scores of edges, on maps whose precision and recall follow by counting."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.quality.edges import scoring
from benchmarks.quality.edges.command import CHOICES, NOT_SCORED
from benchmarks.quality.edges.matching import match, thin


def line(row: int, columns: slice = slice(10, 90), strength: float = 1.0):
    """A horizontal line in a map of 100 x 100: the reach is 1.06 pixels."""
    drawn = np.zeros((100, 100), np.float32)
    drawn[row, columns] = strength
    return drawn


def test_a_map_equal_to_what_everybody_drew_scores_one():
    strength = line(50)
    thresholds = np.array([0.5, 1.0], np.float32)
    counts = scoring.count(strength, [strength > 0, strength > 0], thresholds)
    assert counts.tolist() == [[160, 160, 80, 80]] * 2
    scores = scoring.scores_of([counts], thresholds)
    assert (scores.ods, scores.ois) == pytest.approx((1, 1))


def test_a_line_that_one_of_two_people_drew_is_right_and_half_recalled():
    counts = scoring.count(line(20), [line(20) > 0, line(70) > 0], np.array([0.5], np.float32))
    assert counts.tolist() == [[80, 160, 80, 80]]


def test_a_second_line_beside_a_drawn_one_is_wrong():
    both = line(20) + line(22, strength=0.6)
    counts = scoring.count(both, [line(21) > 0], np.array([0.5, 0.9], np.float32))
    assert counts.tolist() == [[80, 80, 80, 160], [80, 80, 80, 80]]


def test_a_line_two_pixels_off_is_wrong():
    counts = scoring.count(line(22), [line(20) > 0], np.array([0.5], np.float32))
    assert counts.tolist() == [[0, 80, 0, 80]]


def test_one_threshold_for_all_images_scores_less_than_the_best_of_each():
    """Image 1 is perfect at the low threshold, image 2 at the high one: per image F is 1. With one
    threshold: low, precision 20 / 30 and recall 1, F = 0.8; high, precision 1 and recall 15 / 20,
    F = 0.857."""
    first = np.array([[10, 10, 10, 10], [5, 10, 5, 5]], float)
    second = np.array([[10, 10, 10, 20], [10, 10, 10, 10]], float)
    scores = scoring.scores_of([first, second], np.array([0.2, 0.8], np.float32))
    assert scores.ois == 1
    assert scores.ods == pytest.approx(6 / 7, abs=0.01)


def test_strengths_that_never_err_have_an_area_of_one():
    """All hundredths of recall but 0 count, as Berkeley's program has no precision there."""
    drawn = sum(line(row) for row in (20, 40, 60, 80)) > 0
    strength = np.zeros(drawn.shape, np.float32)
    strength[drawn] = np.random.default_rng(0).permutation(320) + 1
    thresholds = scoring.thresholds_of([strength])
    scores = scoring.scores_of([scoring.count(strength, [drawn], thresholds)], thresholds)
    assert (scores.ods, scores.ois, scores.ap) == pytest.approx((1, 1, 1))


def test_thresholds_give_the_densities():
    strength = np.arange(10_000, dtype=np.float32).reshape(100, 100)
    thresholds = scoring.thresholds_of([strength])
    shares = [(strength > each).mean() for each in thresholds[::-1]]
    assert shares == pytest.approx(scoring.DENSITIES)


def test_as_many_pixels_as_possible_are_matched_and_of_those_the_nearest():
    """Column 10 could take either drawn pixel, but column 8 reaches only that in 9."""
    found, drawn = np.zeros((1, 20), bool), np.zeros((1, 20), bool)
    found[0, [8, 10]] = drawn[0, [9, 11]] = True
    matched, number = match(found, drawn, reach=2)
    assert (number, np.flatnonzero(matched).tolist()) == (2, [8, 10])
    found[0, 7] = True  # farther from column 9 than column 8 is
    matched, number = match(found, drawn, reach=2)
    assert (number, np.flatnonzero(matched).tolist()) == (2, [8, 10])
    assert match(found, np.zeros_like(drawn), reach=2)[1] == 0


def test_a_thick_line_becomes_one_of_a_pixel_in_its_middle():
    bar = np.zeros((11, 30), bool)
    bar[4:7, 5:25] = True
    thinned = thin(bar)
    assert thinned[5, 7:23].all()
    assert thinned.sum() == thinned[5].sum()
    line = np.eye(12, dtype=bool)
    assert np.array_equal(thin(line), line)


def test_the_scored_weights_of_learned_are_others_that_find_much_the_same():
    picture = np.full((96, 128, 3), 60, np.uint8)
    picture[:, 64:] = 190
    found, scored = (
        CHOICES[name]().detect(picture).strength for name in (NOT_SCORED, "learned, 160")
    )
    assert not np.array_equal(found, scored)
    for strength in (found, scored):  # the step lies between columns 63 and 64
        columns = strength[16:-16].argmax(axis=1)
        assert np.all(np.abs(columns - 63.5) <= 2)
