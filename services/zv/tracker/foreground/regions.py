"""Finds the connected regions of a foreground mask."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.region import Region, extent

Image = NDArray[np.uint8]


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
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, ltype=cv2.CV_16U)
    areas = stats[1:, cv2.CC_STAT_AREA]
    wanted = np.flatnonzero((areas >= least) & (areas <= most)) + 1
    found = []
    for label in wanted[np.argsort(-areas[wanted - 1], kind="stable")][: limits.most].tolist():
        x, y, width, height, area = stats[label].tolist()
        window = slice(y, y + height), slice(x, x + width)
        own = labels[window] == label
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
    return found
