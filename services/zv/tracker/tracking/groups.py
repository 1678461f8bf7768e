"""Divides a foreground region that several objects share among these objects."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.appearance import BANDS, Scene, levels_of
from zv.tracker.tracking.region import Region, extent, union
from zv.tracker.tracking.state import TrackState

MARGIN_SIDES = 0.25
"""An object is searched for within its expected box plus this margin, in sides."""

DEVIATION = 0.25
"""Standard deviation of where the pixels of an object are, in widths and heights of its box."""

LEAST_COLOR = 0.0005
"""Probability of a colour that an object never showed; equally probable colours have 0.002 each."""

THIN = 0.1
"""Rows and columns with less than this share of the fullest one do not count for the edges."""


def divide(
    targets: Sequence[TrackState], regions: Sequence[Region], scene: Scene
) -> list[Region | None]:
    """Divide regions that objects share among them, pixel by pixel.

    Each pixel is assigned to the object with the largest product of two probabilities: that the
    object is at this place, predicted by its motion, and that it has this colour at this height.
    If objects look the same, the place decides.

    Returns:
        The portion of each object, in the order of ``targets``; None for one without pixels.
    """
    rows, columns = scene.cut(union(regions))
    mask = np.zeros((rows.stop - rows.start, columns.stop - columns.start), bool)
    for part in regions:
        y, x = scene.cut(part)
        window = (
            slice(y.start - rows.start, y.stop - rows.start),
            slice(x.start - columns.start, x.stop - columns.start),
        )
        mask[window] = scene.mask[y, x] > 0
    levels = levels_of(scene.picture[rows, columns])
    best, owner = np.zeros(mask.shape, np.float32), np.full(mask.shape, -1, np.int16)
    origin = rows.start, columns.start
    for number, target in enumerate(targets):
        window, likely = _likely(target, levels, origin)
        better = (likely > best[window]) & mask[window]
        best[window][better] = likely[better]
        owner[window][better] = number
    return [_portion(owner == number, origin) for number in range(len(targets))]


def _likely(
    target: TrackState, levels: NDArray[np.intp], origin: tuple[int, int]
) -> tuple[tuple[slice, slice], NDArray[np.float32]]:
    """Return how probable each pixel of a region is for an object, and where in the region."""
    box, more = target.box, MARGIN_SIDES * target.side
    height, width = levels.shape
    top = max(0, round(box.top - more) - origin[0])
    left = max(0, round(box.left - more) - origin[1])
    bottom = max(top, min(height, round(box.bottom + more) - origin[0]))
    right = max(left, min(width, round(box.right + more) - origin[1]))
    window = slice(top, bottom), slice(left, right)
    v = (np.arange(top, bottom) + origin[0] + 0.5 - box.top) / max(1.0, box.height)
    u = (np.arange(left, right) + origin[1] + 0.5 - box.left) / max(1.0, box.width)
    away = (u - 0.5) ** 2 + ((v - 0.5) ** 2)[:, None]
    prior = np.exp(-away / (2 * DEVIATION**2)).astype(np.float32)
    if target.colors is None:
        return window, prior * LEAST_COLOR
    bands = np.clip((v * BANDS).astype(np.intp), 0, BANDS - 1)
    return window, prior * (target.colors[bands[:, None], levels[window]] + LEAST_COLOR)


def _portion(own: NDArray[np.bool_], origin: tuple[int, int]) -> Region | None:
    """Return the box and the number of an object's pixels; ``origin`` is the first row, column."""
    pixels = cv2.medianBlur(own.astype(np.uint8), 3) > 0
    if not pixels.any():
        return None
    top, bottom = extent(pixels.sum(axis=1), THIN)
    left, right = extent(pixels.sum(axis=0), THIN)
    y, x = origin
    return Region(left + x, top + y, right + x, bottom + y, int(np.count_nonzero(pixels)))
