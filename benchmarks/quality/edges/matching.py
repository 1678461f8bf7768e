"""Thins maps of edges and matches their pixels one to one with those of drawn lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

Map = NDArray[np.bool_]
"""(height, width)."""

UNMATCHED = 100.0
"""Cost of an unmatched pixel, in units of the reach, as in Berkeley's program: so high that as many
pixels as possible are matched, and among such matchings the nearest ones."""


def match(found: Map, drawn: Map, reach: float) -> tuple[Map, int]:
    """Match the pixels of two maps one to one, at the least sum of distances.

    The assignment is exact, while that of Berkeley's ``correspondPixels`` is randomised and misses
    one pair in a thousand.

    Args:
        found: Pixels of the first map.
        drawn: Pixels of the second map.
        reach: Largest distance of two pixels that match, pixels.

    Returns:
        The pixels of ``found`` that have a partner, and how many there are.
    """
    side = int(reach)
    around = np.mgrid[-side : side + 1, -side : side + 1].reshape(2, -1)
    distance = np.hypot(*around)
    (up, left), distance = around[:, distance <= reach], distance[distance <= reach]
    numbers = np.full([length + 2 * side for length in drawn.shape], -1)
    rows, columns = np.nonzero(drawn)
    numbers[rows + side, columns + side] = np.arange(rows.size)
    y, x = np.nonzero(found)
    partners = numbers[y[:, None] + side + up, x[:, None] + side + left]
    with_any = (partners >= 0).any(axis=1)
    y, x, partners = y[with_any], x[with_any], partners[with_any]
    matched = np.zeros_like(found)
    if y.size == 0:
        return matched, 0
    # A separate column for each pixel stands for no match. A cost of 0 would be no entry.
    alone = rows.size + np.arange(y.size)
    partners = np.column_stack([partners, alone])
    costs = np.broadcast_to([*(distance + 1e-3), UNMATCHED * reach], partners.shape)
    possible = partners >= 0
    ends = np.concatenate([[0], np.cumsum(possible.sum(axis=1))])
    graph = csr_array(
        (costs[possible], partners[possible], ends), shape=(y.size, rows.size + y.size)
    )
    pixels, chosen = min_weight_full_bipartite_matching(graph)
    kept = pixels[chosen < rows.size]
    matched[y[kept], x[kept]] = True
    return matched, kept.size


def thin(found: Map) -> Map:
    """Return a map with lines of one pixel's width.

    Source: Z. Guo, R. Hall, "Parallel Thinning with Two-Subiteration Algorithms", 1989: the first
    of the two, which Berkeley's program uses too.
    """
    found = found.copy()
    removed = True
    while removed:
        removed = False
        for turn in (0, 1):
            surplus = _surplus(found, turn)
            removed = removed or bool(surplus.any())
            found &= ~surplus
    return found


def _surplus(found: Map, turn: int) -> Map:
    """Return the pixels that one of the two alternating steps removes."""
    wide = np.pad(found, 1)
    height, width = found.shape
    # East, north-east, north, north-west, west, south-west, south, south-east.
    places = ((1, 2), (0, 2), (0, 1), (0, 0), (1, 0), (2, 0), (2, 1), (2, 2))
    x = [wide[row : row + height, column : column + width] for row, column in places]
    corners = [(x[2 * i + 1] | x[(2 * i + 2) % 8]) for i in range(4)]
    crossings = sum((~x[2 * i] & corners[i]).astype(np.uint8) for i in range(4))
    first = sum((x[2 * i] | x[2 * i + 1]).astype(np.uint8) for i in range(4))
    second = sum(corner.astype(np.uint8) for corner in corners)
    least = np.minimum(first, second)
    kept = (x[5] | x[6] | ~x[3]) & x[4] if turn else (x[1] | x[2] | ~x[7]) & x[0]
    return found & (crossings == 1) & (least >= 2) & (least <= 3) & ~kept
