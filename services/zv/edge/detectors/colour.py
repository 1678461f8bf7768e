"""The detector ``colour``: boundaries from colour differences at three scales, without learning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import cv2
import numpy as np

from zv.edge.detectors.detection import Picture, Strength
from zv.edge.detectors.ridges import RidgeDetector

LIGHTNESS_WEIGHT: Final = 0.04
"""Of squared differences of lightness; those of a and b weigh 1. Objects differ by colour, while
shadows and texture differ by lightness."""

FLOOR: Final = 6.0
"""Added to the mean difference of the picture, so that the noise of an empty one stays weak."""


@dataclass(frozen=True, slots=True)
class Colour(RidgeDetector):
    """Boundaries where colour changes over 2 to 8 pixels, thinned along their ridges.

    The half-size picture in CIE L*a*b* is smoothed at three scales. At each scale the strength is
    the root of the length of the Sobel gradient summed over the three channels (S. Di Zenzo, "A
    note on the gradient of a multi-image", 1986), in which lightness weighs little. The scales'
    sum, divided by its mean over the picture plus a floor, is x; the strength is x / (1 + x).
    """

    thresholds: ClassVar = (
        1.0,
        0.52,
        0.475,
        0.441,
        0.413,
        0.387,
        0.361,
        0.336,
        0.311,
        0.286,
        0.261,
    )

    def strengths(self, half: Picture) -> Strength:
        """Return the strengths of a picture at half its size: float32, 0 to 1."""
        lab = np.asarray(cv2.cvtColor(half, cv2.COLOR_BGR2LAB), np.uint8)
        quarter = np.asarray(cv2.pyrDown(lab), np.uint8)
        fine = np.asarray(cv2.GaussianBlur(lab, (5, 5), 1), np.uint8)
        total = difference(fine) + difference(nearly_gaussian(lab))
        total += cv2.resize(
            difference(nearly_gaussian(quarter)), lab.shape[1::-1], interpolation=cv2.INTER_LINEAR
        )
        total *= np.float32(1 / (float(total.mean()) + FLOOR))
        return total / (1 + total)


def nearly_gaussian(lab: Picture) -> Picture:
    """Return a picture after two means of 5 x 5, which have the variance of a Gaussian of 2."""
    return np.asarray(cv2.blur(cv2.blur(lab, (5, 5)), (5, 5)), np.uint8)


def difference(lab: Picture) -> Strength:
    """Return the root of the gradient's length, (height, width) float32."""
    dx = cv2.Sobel(lab, cv2.CV_32F, 1, 0)
    dy = cv2.Sobel(lab, cv2.CV_32F, 0, 1)
    squares = np.zeros(lab.shape, np.float32)
    cv2.accumulateSquare(dx, squares)
    cv2.accumulateSquare(dy, squares)
    squared = cv2.transform(squares, np.array([[LIGHTNESS_WEIGHT, 1, 1]], np.float32))
    return np.asarray(np.sqrt(np.sqrt(squared)), np.float32)
