"""Which fragments belong to which objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from lap import lapjv
from numpy.typing import NDArray

from zv.tracker.tracking.fragment import Fragment

IMPOSSIBLE = 1e4
"""More than any other cost; lapjv itself takes 1e6 to be without bound."""


def corners(boxes: Sequence[Fragment]) -> NDArray[np.float64]:
    """Return left, top, right and bottom of boxes as (n, 4)."""
    return np.array(
        [(each.left, each.top, each.right, each.bottom) for each in boxes], np.float64
    ).reshape(-1, 4)


def overlaps(first: Sequence[Fragment], second: Sequence[Fragment]) -> NDArray[np.float64]:
    """Return the shared area of each pair of boxes, as a share of the smaller: (n, m), 0 to 1."""
    one, two = corners(first)[:, None], corners(second)[None]
    sides = np.minimum(one[..., 2:], two[..., 2:]) - np.maximum(one[..., :2], two[..., :2])
    shared = np.clip(sides, 0, None).prod(axis=2)
    areas = [np.prod(each[..., 2:] - each[..., :2], axis=2) for each in (one, two)]
    smaller = np.minimum(*areas)
    shares: NDArray[np.float64] = np.divide(
        shared, smaller, out=np.zeros_like(shared), where=smaller > 0
    )
    return shares


def components(links: NDArray[np.bool_]) -> list[tuple[list[int], list[int]]]:
    """Return the connected sets of rows and columns of a matrix of links, in order.

    Rows and columns without a link are in none.
    """
    root = list(range(links.shape[0]))
    first: dict[int, int] = {}  # the first row of each column

    def root_of(row: int) -> int:
        while root[row] != row:
            row = root[row]
        return row

    pairs = [(int(row), int(column)) for row, column in np.argwhere(links)]
    for row, column in pairs:
        one, two = root_of(row), root_of(first.setdefault(column, row))
        root[max(one, two)] = min(one, two)
    found: dict[int, tuple[set[int], set[int]]] = {}
    for row, column in pairs:
        members, reached = found.setdefault(root_of(row), (set(), set()))
        members.add(row)
        reached.add(column)
    return [(sorted(members), sorted(reached)) for _, (members, reached) in sorted(found.items())]


def assigned(costs: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the pairs of rows and columns with the least sum of costs, none ``IMPOSSIBLE``.

    Source: R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for dense and sparse
    linear assignment problems", 1987 (lap).
    """
    if not costs.size:
        return []
    _, columns, _ = lapjv(np.minimum(costs, IMPOSSIBLE), extend_cost=True)
    return [
        (row, int(column))
        for row, column in enumerate(columns)
        if column >= 0 and costs[row, column] < IMPOSSIBLE
    ]
