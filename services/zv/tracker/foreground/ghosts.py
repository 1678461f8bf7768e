"""Recognises ghosts: foreground where an object has left but is still in the background."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

BAND = np.ones((5, 5), np.uint8)


@dataclass(frozen=True, slots=True)
class GhostLimits:
    """The constants of ghosts.

    Attributes:
        evidence: What has less evidence is a ghost.
        edges: Thresholds of the edges at which a region is divided (Canny), grey levels.
        free: Least share of a part's outline that must border on background; the evidence of a part
            inside of an object cannot be measured.
        least: Least area of a part, as a share of its region.
    """

    evidence: float = 1.0
    edges: tuple[float, float] = (40.0, 80.0)
    free: float = 0.25
    least: float = 0.1


def ghosts_in(
    picture: Image, background: Image, region: Image, mask: Image, limits: GhostLimits
) -> Image:
    """Return the parts of a region that stands which are ghosts: (height, width) uint8, 255 there.

    A region may be an object and its own ghost, such as a car that was parked and has moved by half
    of its length. It is therefore divided at the edges in the picture.

    Args:
        picture: (height, width, 3) uint8 BGR, the part around the region.
        background: The same part of the background.
        region: (height, width) uint8, 255 in the region, else 0.
        mask: The same, for all of the foreground.
        limits: The constants.
    """
    ghosts, tested = np.zeros_like(region), False
    lines = cv2.dilate(cv2.Canny(picture, *limits.edges), np.ones((3, 3), np.uint8))
    parts = cv2.bitwise_and(region, cv2.bitwise_not(lines))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(parts, ltype=cv2.CV_16U)
    least = limits.least * cv2.countNonZero(region)
    for label in range(1, count):
        if stats[label, cv2.CC_STAT_AREA] < least:
            continue
        part = np.asarray(labels == label).view(np.uint8) * np.uint8(255)
        part = np.asarray(cv2.dilate(part, BAND), np.uint8) & region
        line = np.asarray(cv2.dilate(part, BAND), np.uint8) & ~part
        if cv2.countNonZero(line & ~mask) < limits.free * cv2.countNonZero(line):
            continue
        tested = True
        if evidence(picture, background, part, mask) < limits.evidence:
            ghosts |= part
    if not tested and evidence(picture, background, region, mask) < limits.evidence:
        return region
    return ghosts


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
