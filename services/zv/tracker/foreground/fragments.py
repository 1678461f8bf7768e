"""Finds the connected regions of a foreground mask, and cuts those of several objects apart."""

from __future__ import annotations

import operator

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.fragment import Fragment

NARROW = 0.2
"""Least width of an object beside another one, as a share of the region's height."""

TALL = 0.5
VALLEY = 0.6
"""Two objects are cut apart at a column with less than this share of the smaller peak beside it."""

SMOOTHING = np.array([0.25, 0.5, 0.25])

THIN = 0.06
"""Rows and columns at the ends of a region with less than this share of the fullest are cut."""

THINNEST = 2.5
"""Regions with a smaller mean thickness, in pixels, are jittering edges, tapes or wires."""


def fragments_of(mask: NDArray[np.uint8], min_area: float, max_area: float) -> list[Fragment]:
    """Return the connected regions of a mask, except thin ones, and without their thin ends.

    Args:
        mask: (height, width) uint8, 255 on the foreground, else 0.
        min_area: Smaller regions are left out, square pixels.
        max_area: Larger regions are left out, square pixels.
    """
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    found = []
    for contour in contours:
        x, y, width, height = cv2.boundingRect(contour)
        least = max(min_area, THINNEST * max(width, height))
        if width * height < least:
            continue
        region = mask[y : y + height, x : x + width]
        columns = _profile(region, 0)
        area = sum(columns) / 255
        if not least <= area <= max_area:
            continue
        for first, end in _cuts(columns, height):
            across, down = columns[first:end], _profile(region[:, first:end], 1)
            (left, right), (top, bottom) = _full(across), _full(down)
            at = x + first + _middle(across), y + _middle(down)
            own = sum(across) / 255
            box = x + first + left, y + top, x + first + right, y + bottom
            found.append(Fragment(*box, own, at))
    return found


def _cuts(columns: list[int], height: int) -> list[tuple[int, int]]:
    """Return the column ranges of objects that seem to stand side by side in a region.

    They are cut apart at a column with far fewer pixels than the fullest ones on both sides, as
    between two heads.

    Args:
        columns: 255 times the number of foreground pixels in each column.
        height: Height of the region.
    """
    width = len(columns)
    narrow = max(3, round(NARROW * height))
    if width <= 2 * narrow:
        return [(0, width)]
    if min(columns[narrow : width - narrow]) > VALLEY * max(columns):
        return [(0, width)]  # fast path for most objects
    smooth = np.convolve(columns, SMOOTHING, mode="same")
    before = np.maximum.accumulate(smooth)
    after = np.maximum.accumulate(smooth[::-1])[::-1]
    peaks = np.minimum(before, after)
    inside = slice(narrow, width - narrow)
    depth = np.where(peaks > TALL * 255 * height, smooth / np.maximum(peaks, 1), 1.0)[inside]
    if not depth.size or depth.min() > VALLEY:
        return [(0, width)]
    cut = narrow + int(np.argmin(depth))
    return [
        *_cuts(columns[:cut], height),
        *((cut + first, cut + end) for first, end in _cuts(columns[cut:], height)),
    ]


def _profile(region: NDArray[np.uint8], axis: int) -> list[int]:
    """Return 255 times the number of pixels in each column (axis 0) or row (1)."""
    sums = cv2.reduce(region, axis, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
    return np.asarray(sums, np.int32).ravel().tolist()


def _middle(profile: list[int]) -> float:
    """Return the mean position of the pixels in columns or rows."""
    moment: int = sum(map(operator.mul, profile, range(len(profile))))
    return moment / sum(profile) + 0.5


def _full(profile: list[int]) -> tuple[int, int]:
    """Return the range, end exclusive, from the first to the last column or row not thin."""
    least = THIN * max(profile)
    enough = [place for place, number in enumerate(profile) if number >= least]
    return enough[0], enough[-1] + 1
