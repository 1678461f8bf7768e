"""Overlap of boxes, connected components of a bipartite graph, and minimum-cost assignment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from lap import lapjv
from numpy.typing import NDArray

from zv.tracker.tracking.region import Region

IMPOSSIBLE = 1e4
"""Cost of a pair that is never assigned, above all other costs; lapjv treats 1e6 as infinite."""


def overlaps(first: Sequence[Region], second: Sequence[Region]) -> NDArray[np.float64]:
    """Return the intersection of each pair of boxes over the smaller area: (n, m), 0 to 1."""
    shared, areas, others = _intersections(first, second)
    return np.asarray(shared / np.maximum(np.minimum(areas, others), 1e-9))


def unions(first: Sequence[Region], second: Sequence[Region]) -> NDArray[np.float64]:
    """Return the intersection over union of each pair of boxes: (n, m), 0 to 1."""
    shared, areas, others = _intersections(first, second)
    return np.asarray(shared / np.maximum(areas + others - shared, 1e-9))


def _intersections(
    first: Sequence[Region], second: Sequence[Region]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the intersection of each pair of boxes, (n, m); and the areas, (n, 1) and (1, m)."""
    left, top, right, bottom = edges(first)[:, :, None]
    others_left, others_top, others_right, others_bottom = edges(second)[:, None]
    across = np.minimum(right, others_right) - np.maximum(left, others_left)
    along = np.minimum(bottom, others_bottom) - np.maximum(top, others_top)
    shared = np.maximum(across, 0) * np.maximum(along, 0)
    others = (others_right - others_left) * (others_bottom - others_top)
    return shared, (right - left) * (bottom - top), others


def edges(boxes: Sequence[Region]) -> NDArray[np.float64]:
    """Return left, top, right and bottom of boxes as (4, n)."""
    edges = [(each.left, each.top, each.right, each.bottom) for each in boxes]
    return np.array(edges, np.float64).reshape(-1, 4).T


def components(links: NDArray[np.bool_]) -> list[tuple[list[int], list[int]]]:
    """Return the connected components of a bipartite graph of rows and columns, in order of rows.

    Rows and columns without a link are left out.
    """
    found: list[tuple[list[int], set[int]]] = []
    for row in np.flatnonzero(links.any(axis=1)).tolist():
        rows, columns, apart = [row], set(np.flatnonzero(links[row]).tolist()), []
        for group in found:
            if columns.isdisjoint(group[1]):
                apart.append(group)
            else:
                rows, columns = group[0] + rows, columns | group[1]
        found = [*apart, (rows, columns)]
    return sorted((sorted(rows), sorted(columns)) for rows, columns in found)


def assigned(costs: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the assignment of rows to columns with the least sum of costs.

    Pairs whose cost is ``IMPOSSIBLE`` or more are left out.

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
