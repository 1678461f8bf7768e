"""Finds the connected regions of a foreground mask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.region import Region, extent

Image = NDArray[np.uint8]

Outline = NDArray[Any]
"""Corners, (n, 1, 2) int32, closed."""


@dataclass(frozen=True, slots=True)
class RegionLimits:
    """The constants of regions."""

    strong: float = 0.03  # least share of a region's pixels that must be strong
    # Rows and columns at the ends of a region with less than this share of the fullest one are cut
    # off: arms, sticks, links to something else.
    thin: float = 0.05
    # Largest number of regions; the smallest of more are left out, so that the time for a frame is
    # bounded.
    most: int = 400


def regions_of(
    mask: Image, strong: Image, least: float, most: float, limits: RegionLimits
) -> list[Region]:
    """Return the connected regions of a mask, the largest first.

    Args:
        mask: (height, width) uint8 of 0 and 255.
        strong: The same: pixels that are certainly foreground.
        least: Smaller regions are left out, square pixels.
        most: Larger regions are left out, square pixels.
        limits: The constants.
    """
    found = []
    for outlines, (x, y, width, height) in _largest(mask, least, limits.most):
        window = slice(y, y + height), slice(x, x + width)
        filled = np.zeros((height, width), np.uint8)
        cv2.drawContours(filled, outlines, -1, (255,), cv2.FILLED, offset=(-x, -y))
        own = filled > 0
        area = int(np.count_nonzero(own))
        if not least <= area <= most:
            continue
        if np.count_nonzero(strong[window][own]) < limits.strong * area:
            continue
        across, down = own.sum(axis=0), own.sum(axis=1)
        left, right = extent(across, limits.thin)
        top, bottom = extent(down, limits.thin)
        at = (
            x + float(across @ np.arange(width)) / area + 0.5,
            y + float(down @ np.arange(height)) / area + 0.5,
        )
        found.append(Region(x + left, y + top, x + right, y + bottom, area, at))
    return sorted(found, key=lambda each: -each.area)


def _largest(mask: Image, least: float, most: int) -> list[tuple[list[Outline], Sequence[int]]]:
    """Return the outlines of the largest regions, each with those of its holes, and their boxes.

    To follow outlines takes an eighth of the time that labelling each pixel takes.

    Args:
        mask: (height, width) uint8 of 0 and 255.
        least: Regions with smaller boxes are left out, square pixels.
        most: Largest number of regions.
    """
    found, links = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    boxes = [cv2.boundingRect(outline) for outline in found]
    sizes = [width * height for _, _, width, height in boxes]
    parents = [] if links is None else links[0, :, 3].tolist()  # -1: it is no outline of a hole
    outer = [each for each, parent in enumerate(parents) if parent < 0 and sizes[each] >= least]
    outer = sorted(outer, key=lambda each: -sizes[each])[:most]
    outlines = {each: [found[each]] for each in outer}
    for hole, parent in enumerate(parents):
        if parent in outlines:
            outlines[parent].append(found[hole])
    return [(outlines[each], boxes[each]) for each in outer]
