"""Joins the pieces in which one object is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from zv.tracker.tracking import boxes
from zv.tracker.tracking.region import Region, union


@dataclass(frozen=True, slots=True)
class PieceLimits:
    """The constants of joining pieces."""

    stacked: float = 0.15  # pieces one above the other belong together up to this gap, in sides
    beside: float = 0.05  # pieces side by side belong together up to this gap, in sides
    # An object claims a piece if it shares more than this part of the smaller box.
    claimed: float = 0.4


def joined(
    regions: Sequence[Region], objects: Sequence[Region], limits: PieceLimits
) -> list[Region]:
    """Join pieces of one object: those that are stacked or touch.

    They stay apart if different ones of some boxes claim them, where objects that are known well
    are expected.
    """
    if len(regions) < 2:
        return list(regions)
    left, top, right, bottom = boxes.edges(regions)
    sides = np.sqrt((right - left) * (bottom - top))
    side = np.maximum(sides[:, None], sides[None])
    across = np.maximum(left[:, None], left[None]) - np.minimum(right[:, None], right[None])
    along = np.maximum(top[:, None], top[None]) - np.minimum(bottom[:, None], bottom[None])
    narrow = np.minimum((right - left)[:, None], (right - left)[None])
    stacked = (-across > 0.5 * narrow) & (along < limits.stacked * side)
    beside = (across < limits.beside * side) & (along < limits.beside * side)
    near = np.triu(stacked | beside, 1)
    if not near.any():
        return list(regions)
    owner = np.full(len(regions), -1)
    if objects:
        shares = boxes.overlaps(regions, objects)
        owner = np.where(shares.max(axis=1) > limits.claimed, shares.argmax(axis=1), -1)
    group = list(range(len(regions)))
    owners = [{int(one)} - {-1} for one in owner]
    found = list(regions)
    for one, other in np.argwhere(near).tolist():
        first, second = sorted((group[one], group[other]))
        both = owners[first] | owners[second]
        if first == second or len(both) > 1:
            continue
        owners[first], found[first] = both, union((found[first], found[second]))
        group = [first if each == second else each for each in group]
    return [found[number] for number in sorted(set(group))]


def around_largest(owned: list[Region]) -> Region:
    """Return the largest region of a track with those above and below it, but not beside it."""
    ordered = sorted(owned, key=lambda each: -each.area)
    found = ordered[0]
    for each in ordered[1:]:
        shared = min(each.right, found.right) - max(each.left, found.left)
        if shared > 0.5 * each.width:
            found = union((found, each))
    return found
