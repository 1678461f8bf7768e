"""Cuts the regions of a foreground mask where convex objects touch."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

LEAST_DEPTH, LEAST_DEPTH_SHARE = 1.2, 0.05
"""Least depth of a concavity at which a cut may begin: in pixels, and as a share of the root of the
region's area."""

LEAST_MISSING = 0.02
"""A region that lacks a smaller share of its convex hull is one object."""

MAX_LEFT = 0.5
"""The parts lack at most this share of the area that the whole lacks of its convex hull."""

LEAST_PART = 0.15
"""Least share of the region's area for a part; smaller ones are noise at the edge of an object."""

LONGEST_CUT = 1.6
"""Longest cut, as a multiple of the root of the smaller part's area."""

MAX_CORNERS, MAX_STARTS = 128, 8
"""Most corners of an outline, and most concavities at which cuts of it are tried, so that the time
for a region has a bound."""

Outline = NDArray[np.int32]
"""(n, 1, 2), closed."""


def cut_at_concavities(mask: NDArray[np.uint8], min_area: float) -> NDArray[np.uint8]:
    """Return a mask with the regions that are not convex cut into convex parts.

    Where two convex objects touch, there is a concavity at each end of the line between them, or at
    one if the objects are flush at the other. Of the straight cuts that begin in a concavity, the
    one whose parts are most convex is made; then the parts are cut in the same way.

    Args:
        mask: (height, width) uint8, 255 on the foreground, else 0; not modified.
        min_area: Least area of a part, square pixels.
    """
    found, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outlines = [_thinned(np.asarray(each, np.int32)) for each in found]
    cut = mask
    while outlines:
        outline = outlines.pop()
        ends = _best_cut(outline, min_area)
        if ends is None:
            continue
        if cut is mask:
            cut = mask.copy()
        one, other = (outline[each, 0].tolist() for each in ends)
        # a line of 8-connected pixels leaves corners of the parts that touch
        cv2.line(cut, one, other, (0,), lineType=cv2.LINE_4)
        outlines += _parts(outline, *ends)
    return cut


def _thinned(outline: Outline) -> Outline:
    return np.ascontiguousarray(outline[:: -(-len(outline) // MAX_CORNERS)])


def _best_cut(outline: Outline, min_area: float) -> tuple[int, int] | None:
    """Return the two corners of an outline between which it is to be cut; None for no cut."""
    area = cv2.contourArea(outline)
    if area < 2 * min_area:
        return None
    missing = _missing(outline)
    if missing < LEAST_MISSING * area:
        return None
    best, fewest = None, MAX_LEFT * missing
    least = max(min_area, LEAST_PART * area)
    starts = _concavities(outline, max(LEAST_DEPTH, LEAST_DEPTH_SHARE * math.sqrt(area)))
    for start in starts:
        lengths = np.hypot(*(outline[:, 0] - outline[start, 0]).T)
        near = set(np.flatnonzero(lengths <= LONGEST_CUT * math.sqrt(area / 2))[::2].tolist())
        for end in near.union(starts) - {start}:
            parts = _parts(outline, *sorted((start, end)))
            areas = [cv2.contourArea(part, oriented=True) for part in parts]
            if areas[0] * areas[1] <= 0:
                continue  # a line outside of the region, across the mouth of a concavity
            smaller = min(map(abs, areas))
            if smaller < least or lengths[end] > LONGEST_CUT * math.sqrt(smaller):
                continue
            left = sum(map(_missing, parts))
            if left < fewest:
                best, fewest = (min(start, end), max(start, end)), left
    return best


def _concavities(outline: Outline, least: float) -> list[int]:
    """Return the innermost corners of the deepest concavities, of at least this depth in pixels."""
    hull = np.sort(cv2.convexHull(outline, returnPoints=False), axis=0)  # OpenCV wants it in order
    defects = cv2.convexityDefects(outline, hull)
    if defects is None:
        return []
    found = [(depth, at) for _, _, at, depth in defects.reshape(-1, 4).tolist()]
    deepest = sorted(found, reverse=True)[:MAX_STARTS]
    return [int(at) for depth, at in deepest if depth >= least * 256]


def _parts(outline: Outline, first: int, last: int) -> tuple[Outline, Outline]:
    """Return the two outlines into which a straight line between two corners cuts an outline."""
    return outline[first : last + 1], np.concatenate([outline[last:], outline[: first + 1]])


def _missing(outline: Outline) -> float:
    """Return the area between an outline and its convex hull, square pixels."""
    return cv2.contourArea(cv2.convexHull(outline)) - cv2.contourArea(outline)
