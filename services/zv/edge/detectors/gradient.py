"""The gradient operators of Roberts, Sobel, Prewitt and Scharr, with non-maximum suppression.

The strengths of all operators are in one unit, so that a threshold means the same for each: the
magnitude of the 3x3 Sobel operator, which is 8 times the slope in grey levels per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import GradientDetection, GradientDetector
from zv.edge.detectors.rendering import Picture

SOBEL_GAIN: Final = 8
"""Response of the 3x3 Sobel operator to a slope of one grey level per pixel."""


@dataclass(frozen=True, slots=True)
class Operator(GradientDetector):
    """Gradient, non-maximum suppression, one threshold; there is a subclass for each operator.

    Attributes:
        weights: Factor of the kernels across the derivative's direction.
        differences: Factor of the kernels along the derivative's direction, in rising coordinates.
    """

    sigma: float = 1.4
    high: float = 100.0
    l2: bool = True

    weights: ClassVar[tuple[int, ...]]
    differences: ClassVar[tuple[int, ...]] = (-1, 0, 1)

    @property
    def unit(self) -> float:
        """Factor from this operator's responses to the common unit."""
        slope = sum(x * each for x, each in enumerate(self.differences))
        return SOBEL_GAIN / (sum(self.weights) * slope)

    @property
    def full_scale(self) -> float:
        """An upper bound of the magnitude that 8-bit pixels can have."""
        return 255 * sum(self.weights) * self.unit * (2**0.5 if self.l2 else 2.0)

    def detect(self, picture: Picture) -> OperatorDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return OperatorDetection(self, picture)


class Roberts(Operator):
    """L. G. Roberts, "Machine Perception of Three-Dimensional Solids", 1963: a cross of 2x2.

    The cross is turned by 45 degrees: the sum and the difference of its diagonal differences. The
    magnitude is sqrt(2) times the cross's own, before it is scaled to the unit of all operators.
    The derivative belongs to the corner between four pixels, so the line is at the pixel whose
    lower right corner that is: half a pixel too far to the left and too high.
    """

    weights = (1, 1)
    differences = (-1, 1)

    @property
    def full_scale(self) -> float:
        """An upper bound of the magnitude; the two derivatives are never both at their largest."""
        return 255 * sum(self.weights) * self.unit


class Prewitt(Operator):
    """J. M. S. Prewitt, "Object Enhancement and Extraction", 1970: 3x3, equal weights."""

    weights = (1, 1, 1)


class Sobel(Operator):
    """I. Sobel and G. Feldman, 1968: 3x3, weights 1 2 1."""

    weights = (1, 2, 1)


class Scharr(Operator):
    """H. Scharr, "Optimale Operatoren in der Digitalen Bildverarbeitung", 2000: weights 3 10 3.

    Its direction is the most exact of the 3x3 operators.
    """

    weights = (3, 10, 3)


class OperatorDetection(GradientDetection[Operator]):
    """The edges of one picture by a gradient operator, and its steps."""

    @cached_property
    def gradient(self) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Derivatives to the right and downwards in the operator's unit, (height, width) int16.

        At the border the picture continues with its outermost pixels.
        """
        weights, differences = np.array(
            [self._detector.weights, self._detector.differences], np.float32
        )
        gx, gy = (
            cv2.sepFilter2D(
                self.smoothed,
                cv2.CV_16S,
                *factors,
                anchor=(0, 0) if len(weights) == 2 else (-1, -1),
                borderType=cv2.BORDER_REPLICATE,
            )
            for factors in ((differences, weights), (weights, differences))
        )
        return np.asarray(gx, np.int16), np.asarray(gy, np.int16)
