"""Tells an object from a ghost: the place of something that has left the learned background."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

MARGIN = 4
GHOST_RATIO = 1.4
LEAST_EDGE = 5.0
"""Mean gradient, grey levels per pixel, below which an outline says nothing."""


def is_ghost(
    picture: Image, background: Image, mask: Image, box: tuple[int, int, int, int]
) -> bool:
    """Return whether the outline of a foreground region is an edge of the background instead.

    A real object has an edge along its outline in the picture, and none in the background. A
    ghost, which is what the background remembers of something that has left, is the other way
    round. Compared are the mean gradients along the outline.

    Args:
        picture: (height, width, 3) uint8 BGR.
        background: The same.
        mask: (height, width) uint8, not 0 on the foreground.
        box: x, y, width, height of the region.
    """
    x, y, width, height = box
    top, left = max(0, y - MARGIN), max(0, x - MARGIN)
    cut = slice(top, y + height + MARGIN), slice(left, x + width + MARGIN)
    region = mask[cut]
    if not region.size:
        return False
    kernel = np.ones((3, 3), np.uint8)
    outline = cv2.subtract(cv2.dilate(region, kernel), cv2.erode(region, kernel)) > 0
    if not outline.any():
        return False
    shown, remembered = (_gradient(image[cut], outline) for image in (picture, background))
    return remembered > LEAST_EDGE and remembered > GHOST_RATIO * shown


def _gradient(image: Image, where: NDArray[np.bool_]) -> float:
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    gradients = [np.abs(cv2.Sobel(grey, cv2.CV_32F, dx, 1 - dx))[where] for dx in (0, 1)]
    return float(np.mean(gradients[0] + gradients[1])) / 8  # Sobel's weights sum up to 8
