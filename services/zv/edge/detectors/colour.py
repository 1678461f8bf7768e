"""The detector ``colour``: boundaries from colour differences at three scales, without learning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import cv2
import numpy as np

from zv.edge.detectors.detection import Picture, Strength
from zv.edge.detectors.ridges import RidgeDetector, half_size

LIGHTNESS_WEIGHT: Final = 0.08
"""Weight of squared differences of lightness; those of a and b have the weight 1. Objects differ by
colour, while shadows and texture differ by lightness."""

FLOOR: Final = 40.0
"""Added to the mean difference, so that noise in a picture without objects stays weak."""

FINE_WEIGHT: Final = np.float32(2.0)
"""Weight of the difference at the finest scale; the one at the middle scale has the weight 1."""

COARSE_WEIGHT: Final = np.float32(0.5)
"""Weight of the difference at the coarsest scale. Its pixels are twice as far apart, so that their
differences are twice as large."""

SURROUNDINGS: Final = 61
"""Side of the square around a pixel, in pixels of the half-size picture. Its mean difference weighs
as much as that of the whole picture: boundaries in calm parts are stronger than in texture."""

THRESHOLDS: Final = (1.0, 0.618, 0.546, 0.491, 0.445, 0.404, 0.367, 0.331, 0.296, 0.26, 0.225)
"""Measured by ``python -m benchmarks.quality edges --thresholds --detectors colour``."""


@dataclass(frozen=True, slots=True)
class Colour(RidgeDetector):
    """Finds boundaries where the colour changes over 2 to 8 pixels, thinned along their ridges.

    The half-size picture in CIE L*a*b* is smoothed at three scales. At each scale the difference
    is the length of the Sobel gradient summed over the three channels (S. Di Zenzo, "A note on the
    gradient of a multi-image", 1986), in which lightness weighs little. The scales' weighted sum is
    divided by the average of two means, over the picture and over the surroundings, plus a floor;
    if x is the result, the strength is x / (1 + x).
    """

    smoothing: ClassVar = 0.35
    ridge_sigma: ClassVar = 1.5
    thresholds: ClassVar = THRESHOLDS

    def strengths(self, picture: Picture) -> Strength:
        """Return the strengths of a picture at half its size: float32, 0 to 1."""
        lab = np.asarray(cv2.cvtColor(half_size(picture), cv2.COLOR_BGR2LAB), np.uint8)
        quarter = np.asarray(cv2.pyrDown(lab), np.uint8)
        coarse = cv2.resize(
            difference(nearly_gaussian(quarter)), lab.shape[1::-1], interpolation=cv2.INTER_LINEAR
        )
        fine = difference(np.asarray(cv2.GaussianBlur(lab, (5, 5), 1), np.uint8))
        total = np.asarray(FINE_WEIGHT * fine, np.float32)
        total += difference(nearly_gaussian(lab))
        total += COARSE_WEIGHT * np.asarray(coarse, np.float32)
        usual = np.asarray(cv2.blur(total, (SURROUNDINGS, SURROUNDINGS)), np.float32)
        usual += np.float32(total.mean() + 2 * FLOOR)
        total *= 2
        return np.asarray(total / (total + usual), np.float32)

    def seen(self, picture: Picture) -> Picture:
        """Return the picture at the middle scale, BGR."""
        return nearly_gaussian(half_size(picture))


def nearly_gaussian(picture: Picture) -> Picture:
    """Return a picture after two box filters of 5 x 5, about a Gaussian with sigma 2."""
    return np.asarray(cv2.blur(cv2.blur(picture, (5, 5)), (5, 5)), np.uint8)


def difference(lab: Picture) -> Strength:
    """Return the length of the colour gradient of a picture in L*a*b*, (height, width) float32."""
    dx = cv2.Sobel(lab, cv2.CV_32F, 1, 0)
    dy = cv2.Sobel(lab, cv2.CV_32F, 0, 1)
    squares = np.zeros(lab.shape, np.float32)
    cv2.accumulateSquare(dx, squares)
    cv2.accumulateSquare(dy, squares)
    squared = cv2.transform(squares, np.array([[LIGHTNESS_WEIGHT, 1, 1]], np.float32))
    return np.asarray(np.sqrt(squared), np.float32)
