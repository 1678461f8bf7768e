"""The detector ``colour``: boundaries from colour differences at four scales, without learning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import cv2
import numpy as np

from zv.edge.detectors.rendering import Picture, Strength
from zv.edge.detectors.ridges import RidgeDetector, half_size

LIGHTNESS_WEIGHT: Final = 0.08
"""Weight of squared differences of lightness; those of a and b have the weight 1. Objects differ by
colour, while shadows and texture differ by lightness."""

FLOOR: Final = 40.0
"""Added to the mean difference, so that noise in a picture without objects stays weak."""

SUPPORT_WEIGHT: Final = np.float32(3.0)
"""Weight of the geometric mean of the fine and the coarse differences; those at the finest and the
middle scale have the weight 1."""

SURROUNDINGS: Final = 61
"""Side of the square around a pixel, in pixels of the half-size picture. Its mean difference weighs
as much as that of the whole picture: boundaries in calm parts are stronger than in texture."""

THRESHOLDS: Final = (1.0, 0.628, 0.559, 0.507, 0.464, 0.427, 0.393, 0.361, 0.33, 0.3, 0.271)
"""Measured by ``python -m benchmarks.quality edges --thresholds --detectors colour``."""


@dataclass(frozen=True, slots=True)
class Colour(RidgeDetector):
    """Finds boundaries where the colour changes over 2 to 16 pixels, thinned along their ridges.

    The half-size picture in CIE L*a*b* is smoothed at four scales. At each scale the difference
    is the length of the Sobel gradient summed over the three channels (S. Di Zenzo, "A note on the
    gradient of a multi-image", 1986), in which lightness weighs little. The strength is made of the
    differences at the finest and the middle scale, and of the geometric mean of the finest one and
    the sum of the two coarsest ones: it is large only on a thin line that is a boundary of
    something large too, while texture has no coarse difference. Beside a boundary the coarse
    differences are limited to the middle one, since noise would be a line there. The sum of all is
    divided by the average of two means, over the picture and over the surroundings, plus a floor;
    if x is the result, the strength is x / (1 + x).
    """

    smoothing: ClassVar = 0.25
    ridge_sigma: ClassVar = 0.8
    thresholds: ClassVar = THRESHOLDS

    def strengths(self, picture: Picture) -> Strength:
        """Return the strengths of a picture at half its size: float32, 0 to 1."""
        lab = np.asarray(cv2.cvtColor(half_size(picture), cv2.COLOR_BGR2LAB), np.uint8)
        fine = difference(np.asarray(cv2.GaussianBlur(lab, (5, 5), 1), np.uint8))
        middle = difference(nearly_gaussian(lab))
        coarse = np.minimum(coarse_differences(lab), middle)
        total = SUPPORT_WEIGHT * np.asarray(cv2.sqrt(fine * coarse), np.float32)
        total += fine
        total += middle
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


def coarse_differences(lab: Picture) -> Strength:
    """Return the sum of the differences at the two coarsest scales, (height, width) float32.

    They are computed from a quarter and an eighth of the picture's size. There, pixels are two and
    four times as far apart, and differences are as much larger.
    """
    quarter = np.asarray(cv2.pyrDown(lab), np.uint8)
    eighth = np.asarray(cv2.pyrDown(quarter), np.uint8)
    coarse = difference(nearly_gaussian(quarter)) * np.float32(0.5)
    coarsest = difference(nearly_gaussian(eighth)) * np.float32(0.25)
    coarse += enlarged_smoothly(coarsest, quarter)
    return enlarged_smoothly(coarse, lab)


def enlarged_smoothly(values: Strength, picture: Picture) -> Strength:
    """Return a map enlarged to the size of a picture, by bilinear interpolation."""
    size = picture.shape[1::-1]
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_LINEAR), np.float32)


def difference(lab: Picture) -> Strength:
    """Return the length of the colour gradient of a picture in L*a*b*, (height, width) float32."""
    dx = cv2.Sobel(lab, cv2.CV_32F, 1, 0)
    dy = cv2.Sobel(lab, cv2.CV_32F, 0, 1)
    squares = np.zeros(lab.shape, np.float32)
    cv2.accumulateSquare(dx, squares)
    cv2.accumulateSquare(dy, squares)
    squared = cv2.transform(squares, np.array([[LIGHTNESS_WEIGHT, 1, 1]], np.float32))
    return np.asarray(np.sqrt(squared), np.float32)
