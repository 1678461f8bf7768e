"""Draws the polygons inside of which objects are detected or ignored, as a mask."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Polygon = Sequence[tuple[float, float]]
"""Corners x, y in full-resolution pixels."""


def region_mask(
    size: tuple[int, int],
    scale: float,
    regions: Sequence[Polygon],
    ignored: Sequence[Polygon],
) -> NDArray[np.uint8] | None:
    """Return the mask of the region in which objects are detected; None for everywhere.

    Args:
        size: Width and height of the mask.
        scale: Full-resolution pixels per pixel of the mask.
        regions: Objects are detected only inside these; none means everywhere.
        ignored: Objects inside these are ignored.

    Returns:
        (height, width) uint8, 255 where objects are detected, else 0.
    """
    if not regions and not ignored:
        return None
    width, height = size
    mask = np.full((height, width), 0 if regions else 255, np.uint8)
    # OpenCV also fills the pixels on the outline. Corners are given in 1/16 pixels (shift=4).
    for polygons, value in ((regions, 255), (ignored, 0)):
        for polygon in polygons:
            corners = np.round((np.asarray(polygon, float) / scale - 0.5) * 16).astype(np.int32)
            cv2.fillPoly(mask, [corners], (value,), shift=4)
    return mask
