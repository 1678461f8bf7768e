"""Finds each of several objects inside the one region of foreground that they share."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.target import Target

LEAST_REACH, MOST_REACH = 2, 10
DISTANCE_WEIGHT = 0.06
"""Cost of a place one standard deviation away from the prediction."""


def place(targets: Sequence[Target], scene: Scene) -> list[tuple[tuple[float, float], float]]:
    """Return the middle of each object inside a shared region, and the cost of its fit.

    The nearest to the camera, whose foot is the lowest, is placed first; what it covers is not
    searched again for those behind it. An object without a template stays at its prediction.
    """
    free = scene.mask.copy()
    remaining = Scene(scene.picture, free)
    found: dict[int, tuple[tuple[float, float], float]] = {}
    for target in sorted(targets, key=lambda each: (-each.box.bottom, each.id)):
        box, seen = target.box, target.appearance.seen
        middle = target.x.position, target.y.position
        left, top = round(box.left), round(box.top)
        deviations = [max(1.0, math.sqrt(axis.pp) * 1.5) for axis in (target.x, target.y)]
        reach_x, reach_y = (int(min(MOST_REACH, max(LEAST_REACH, 2 * each))) for each in deviations)
        costs = target.appearance.costs(remaining, left, top, reach_x, reach_y)
        if costs is None or seen is None:
            found[target.id] = middle, 1.0
            continue
        dy, dx = np.mgrid[-reach_y : reach_y + 1, -reach_x : reach_x + 1]
        away = np.square((left + dx - box.left) / deviations[0])
        away = away + np.square((top + dy - box.top) / deviations[1])
        row, column = np.unravel_index(int(np.argmin(costs + DISTANCE_WEIGHT * away)), costs.shape)
        step_x, step_y = int(column) - reach_x, int(row) - reach_y
        found[target.id] = (
            (left + step_x + target.width / 2, top + step_y + target.height / 2),
            float(costs[row, column]),
        )
        _cover(free, target, left + step_x, top + step_y)
    return [found[target.id] for target in targets]


def _cover(free: NDArray[np.uint8], target: Target, left: int, top: int) -> None:
    """Take the pixels of a placed object out of the mask."""
    seen = target.appearance.seen
    assert seen is not None
    height, width = seen.shape
    y, x = max(0, top), max(0, left)
    part = free[y : max(y, top + height), x : max(x, left + width)]
    if part.size:
        own = seen[y - top : y - top + part.shape[0], x - left : x - left + part.shape[1]]
        part[own > 0.5] = 0
