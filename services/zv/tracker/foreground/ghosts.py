"""Recognises ghosts: foreground where an object has left but is still in the background."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

BAND = np.ones((5, 5), np.uint8)

LEAST_EVIDENCE = 1.0
"""What has less is a ghost."""


def evidence(picture: Image, background: Image, part: Image, mask: Image) -> float:
    """Return how much more an outline belongs to a picture than to its background.

    Where there is an object, colours change across its outline in the picture, and there is an
    edge. Where an object has left, they do so in the background. Needs no tuning: objects have 1
    to 33, ghosts less than 1.

    Args:
        picture: (height, width, 3) uint8 BGR, the part around the region.
        background: The same part of the background.
        part: (height, width) uint8, 255 in the region whose outline is compared.
        mask: The same, for all of the foreground.

    Returns:
        The contrast times the edges along the outline, in the picture over the background.
    """
    wide = np.asarray(cv2.dilate(part, BAND), np.uint8)
    outside = wide & ~mask
    line = np.asarray(cv2.dilate(outside, BAND), np.uint8)
    if not outside.any():
        return np.inf
    shown, learned = (
        _contrast(each, part, outside) * _edges(each, line) for each in (picture, background)
    )
    return (shown + 1.0) / (learned + 1.0)


def _contrast(picture: Image, inside: Image, outside: Image) -> float:
    """Return the difference of the means and the deviations of the colours, grey levels.

    The deviations show a plain object before a textured background.
    """
    one, other = cv2.meanStdDev(picture, mask=inside), cv2.meanStdDev(picture, mask=outside)
    return float(np.abs(np.subtract(one, other)).sum())


def _edges(picture: Image, line: Image) -> float:
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    along = [np.abs(cv2.Sobel(grey, cv2.CV_32F, dx, 1 - dx)) for dx in (0, 1)]
    return float(cv2.mean(along[0] + along[1], line)[0])
