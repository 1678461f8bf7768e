"""Finds the place of an object in the region of other objects, by its colours."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.appearance import Scene, levels_of
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.groups import CLEAR, KNOWN_COLOR
from zv.tracker.tracking.target import Point, Target


def found_in(
    region: Fragment,
    target: Target,
    others: Sequence[Target],
    last: Point,
    reach: float,
    scene: Scene,
) -> tuple[float, Point]:
    """Return the share of an object that is seen in a region, 0 if none is, and its place there.

    The place is where a box of its size has the most pixels of colours that are clearly its own.

    Args:
        region: A fragment of the foreground.
        target: The object.
        others: The objects that the region belongs to.
        last: The object's last place.
        reach: How far from there it may be, pixels.
        scene: The pixels of the frame.
    """
    x, y, across, down = *last, reach + target.width / 2, reach + target.height / 2
    rows, columns = scene.cut(
        Fragment(
            max(region.left, x - across),
            max(region.top, y - down),
            min(region.right, x + across),
            min(region.bottom, y + down),
            0,
        )
    )
    mask = scene.mask[rows, columns]
    own = _colors(target) if mask.size else None
    if own is None:
        return 0.0, last
    rest = [colors for colors in map(_colors, others) if colors is not None]
    clear = (own > KNOWN_COLOR) & (own > CLEAR * np.max(rest, axis=0, initial=0.0))
    seen = clear[levels_of(scene.picture[rows, columns])] & (mask > 0)
    size = max(1, round(target.width)), max(1, round(target.height))
    counts = cv2.boxFilter(
        seen.astype(np.float32), -1, size, normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    _, most, _, (column, row) = cv2.minMaxLoc(counts)
    place = column + columns.start + 0.5, row + rows.start + 0.5
    if math.dist(place, last) > reach:
        return 0.0, last
    return most / max(1.0, target.area), place


def _colors(target: Target) -> NDArray[np.float32] | None:
    """Return how probable each colour is for a pixel of an object."""
    colors = target.appearance.colors
    return None if colors is None else np.asarray(colors.mean(axis=0), np.float32)
