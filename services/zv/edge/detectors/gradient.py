"""The gradient operators of Roberts, Sobel, Prewitt and Scharr, with non-maximum suppression.

The strengths of all operators are in one unit, so that a threshold means the same for each: the
magnitude of the 3x3 Sobel operator, which is 8 times the slope in grey levels per pixel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Detector, Gray, Picture, Strength
from zv.edge.detectors.rendering import as_gray, as_hue, in_two_grays
from zv.edge.detectors.smoothing import SmoothedDetection
from zv.edge.detectors.thinning import maxima

SOBEL_GAIN: Final = 8
"""Response of the 3x3 Sobel operator to a slope of one grey level per pixel."""


@dataclass(frozen=True, slots=True)
class Operator:
    """A pair of separable kernels, for the horizontal and the vertical derivative.

    Attributes:
        weights: Factor of the kernel across the derivative's direction.
        differences: Factor of the kernel along the derivative's direction, in rising coordinates.
        diagonal: Whether the kernels are the sum and the difference of two diagonal ones, so that
            their magnitudes are never both at their largest.
    """

    weights: tuple[int, ...]
    differences: tuple[int, ...]
    diagonal: bool = False

    @property
    def gain(self) -> int:
        """Response to a slope of one grey level per pixel."""
        return sum(self.weights) * sum(x * each for x, each in enumerate(self.differences))

    @property
    def largest(self) -> int:
        """The largest derivative that 8-bit pixels can have."""
        return 255 * sum(self.weights) * sum(each for each in self.differences if each > 0)


ROBERTS: Final = Operator((1, 1), (-1, 1), diagonal=True)
"""Roberts' cross, turned by 45 degrees: the sum and the difference of its diagonal differences.

The magnitude is sqrt(2) times the cross's own, before it is scaled to the unit of all operators.
The derivative belongs to the corner between four pixels, so the line is at the pixel whose lower
right corner that is: half a pixel too far to the left and too high.
"""
PREWITT: Final = Operator((1, 1, 1), (-1, 0, 1))
SOBEL: Final = Operator((1, 2, 1), (-1, 0, 1))
SCHARR: Final = Operator((3, 10, 3), (-1, 0, 1))


@dataclass(frozen=True, slots=True)
class GradientDetector(Detector):
    """Gradient, non-maximum suppression, one threshold; there is a subclass for each operator.

    Attributes:
        sigma: Standard deviation of the Gaussian applied first, pixels; 0 for none, as in the
            textbook.
        high: Only magnitudes above it are edges, in the unit of the 3x3 Sobel operator.
        l2: Whether the magnitude is sqrt(gx^2 + gy^2) instead of |gx| + |gy|.
    """

    sigma: float = 1.4
    high: float = 100.0
    l2: bool = True

    operator: ClassVar[Operator]

    @property
    def scale(self) -> float:
        """Factor from this operator's responses to the common unit."""
        return SOBEL_GAIN / self.operator.gain

    @property
    def full_scale(self) -> float:
        """An upper bound of the magnitude that 8-bit pixels can have."""
        both = 1.0 if self.operator.diagonal else 2**0.5 if self.l2 else 2.0
        return self.operator.largest * self.scale * both

    def detect(self, picture: Picture) -> GradientDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return GradientDetection(self, picture)


class Roberts(GradientDetector):
    """L. G. Roberts, "Machine Perception of Three-Dimensional Solids", 1963: a cross of 2x2."""

    operator = ROBERTS


class Prewitt(GradientDetector):
    """J. M. S. Prewitt, "Object Enhancement and Extraction", 1970: 3x3, equal weights."""

    operator = PREWITT


class Sobel(GradientDetector):
    """I. Sobel and G. Feldman, 1968: 3x3, weights 1 2 1."""

    operator = SOBEL


class Scharr(GradientDetector):
    """H. Scharr, "Optimale Operatoren in der Digitalen Bildverarbeitung", 2000: weights 3 10 3.

    Its direction is the most exact of the 3x3 operators.
    """

    operator = SCHARR


class GradientDetection(SmoothedDetection[GradientDetector]):
    """The edges of one picture by a gradient operator, and its steps."""

    @cached_property
    def gradient(self) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Derivatives to the right and downwards in the operator's unit, (height, width) int16.

        At the border the picture continues with its outermost pixels.
        """
        operator = self._detector.operator
        weights, differences = np.array(operator.weights), np.array(operator.differences)
        gx, gy = (
            cv2.sepFilter2D(
                self.smoothed,
                cv2.CV_16S,
                along_x.astype(np.float32),
                along_y.astype(np.float32),
                anchor=(0, 0) if len(weights) == 2 else (-1, -1),
                borderType=cv2.BORDER_REPLICATE,
            )
            for along_x, along_y in ((differences, weights), (weights, differences))
        )
        return np.asarray(gx, np.int16), np.asarray(gy, np.int16)

    @cached_property
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8, 0 or 255."""
        threshold = self._detector.high / self._detector.scale
        gx, gy = self.gradient
        edges = cv2.Canny(gx, gy, threshold, threshold, L2gradient=self._detector.l2)
        return np.asarray(edges, np.uint8)

    @cached_property
    def magnitude(self) -> Strength:
        """The gradient's magnitude, (height, width) float32, in the common unit."""
        gx, gy = (derivative.astype(np.float32) for derivative in self.gradient)
        size = cv2.magnitude(gx, gy) if self._detector.l2 else np.abs(gx) + np.abs(gy)
        return np.asarray(size * np.float32(self._detector.scale), np.float32)

    @cached_property
    def strength(self) -> Strength:
        """The magnitude where it is a maximum along the gradient's direction, else 0."""
        return np.where(maxima(*self.gradient, l2=self._detector.l2) > 0, self.magnitude, 0)

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The five steps, each computed when it is called."""
        full, high = self._detector.full_scale, self._detector.high
        return {
            "smoothed": lambda: self.smoothed,
            "magnitude": lambda: as_gray(self.magnitude, full),
            "direction": lambda: as_hue(*self.gradient, as_gray(self.magnitude, full)),
            "suppressed": lambda: as_gray(self.strength, full),
            "thresholded": lambda: in_two_grays(self.strength, high, high),
        }
