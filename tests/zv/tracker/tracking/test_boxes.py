"""Overlaps, connected components and assignments."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from zv.tracker.tracking.boxes import (
    IMPOSSIBLE,
    assigned,
    components,
    overlaps,
)
from zv.tracker.tracking.region import Region


def test_the_overlap_is_relative_to_the_smaller_box():
    large, inside = Region(0, 0, 10, 10, 100), Region(8, 8, 12, 12, 16)
    away = Region(10, 0, 12, 5, 10)  # touches: nothing in common
    # 2 x 2 of 16 pixels
    assert overlaps([large], [inside, away]).tolist() == [[pytest.approx(0.25), 0.0]]
    assert overlaps([large], [Region(30, 30, 40, 40, 9)]) == 0.0  # away along both axes


def test_components_are_connected_across_several_links():
    links = np.array([[1, 1, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 0]], bool)
    assert components(links) == [([0, 2], [0, 1]), ([1], [2])]
    chain = np.eye(6, 5, dtype=bool) | np.eye(6, 5, -1, dtype=bool)
    assert components(chain) == [([0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4])]
    assert components(np.zeros((3, 0), bool)) == []


def test_the_assignment_has_the_least_sum():
    costs = np.random.default_rng(3).uniform(0, 9, (5, 5))
    found = sum(costs[pair] for pair in assigned(costs))
    best = min(
        sum(costs[row, column] for row, column in enumerate(order))
        for order in permutations(range(5))
    )
    assert found == pytest.approx(best)


def test_impossible_pairs_are_not_assigned():
    costs = np.array([[1.0, IMPOSSIBLE], [IMPOSSIBLE, IMPOSSIBLE]])
    assert assigned(costs) == [(0, 0)]
    assert assigned(np.empty((0, 3))) == []


def test_the_assignment_has_the_least_sum_even_with_many_impossible_pairs():
    random = np.random.default_rng(1)
    for _ in range(300):
        costs = random.uniform(0, 9, random.integers(1, 9, 2))
        costs[random.random(costs.shape) < 0.5] = IMPOSSIBLE
        pairs = assigned(costs)
        rows, columns = linear_sum_assignment(costs)
        left = min(costs.shape) - len(pairs)
        assert sum(costs[pair] for pair in pairs) + left * IMPOSSIBLE == pytest.approx(
            costs[rows, columns].sum()
        )
