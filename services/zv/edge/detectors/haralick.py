"""Zero crossings of the second directional derivative of a cubic facet model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import starmap

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.canny import smooth
from zv.edge.detectors.detection import Detection, Detector, Gray, Picture, Strength
from zv.edge.detectors.gradient import SOBEL_GAIN
from zv.edge.detectors.rendering import as_gray, as_hue, in_two_grays
from zv.edge.detectors.zero_crossings import (
    Field,
    distance_to_crossing,
    thin_crossings,
    unit_vectors,
)


@dataclass(frozen=True, slots=True)
class Haralick(Detector):
    """Fits a cubic polynomial to the window of each pixel and takes its derivatives.

    Source: R. M. Haralick, "Digital Step Edges from Zero Crossing of Second Directional
    Derivatives", 1984.

    Attributes:
        sigma: Standard deviation of a Gaussian before it, pixels; 0, as in the paper, for none.
        high: Only gradients above it at the zero crossing are edges, in the unit of the 3x3 Sobel
            operator.
        window: Side of the window, pixels: 5, 7, 9 or 11.
    """

    sigma: float = 1.4
    high: float = 100.0
    window: int = 5

    @property
    def full_scale(self) -> float:
        """A bound of the gradient at a pixel; one extrapolated beyond it is cut off in 16 bits."""
        one, line, square, cube = polynomials(self.window)
        a, b = fit_constants(self.window)
        kernel = np.outer(one, line) - b * np.outer(one, cube) - a * np.outer(square, line)
        return float(255 / 2 * np.abs(kernel).sum() * 2**0.5 * SOBEL_GAIN)

    def detect(self, picture: Picture) -> HaralickDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return HaralickDetection(self, picture)


@cache
def polynomials(side: int) -> tuple[NDArray[np.float32], ...]:
    """Return the weights that fit polynomials of degree 0 to 3 to a line of pixels, float32.

    They are the discrete orthogonal ones, 1, x, x^2 - a and x^3 - b x, each over its sum of
    squares: the correlation with a line of pixels is then the coefficient of the least squares.
    """
    x = np.arange(side, dtype=np.float64) - side // 2
    a, b = fit_constants(side)
    values = (np.ones_like(x), x, x**2 - a, x**3 - b * x)
    return tuple((each / (each**2).sum()).astype(np.float32) for each in values)


@cache
def fit_constants(side: int) -> tuple[float, float]:
    """Return a and b of the polynomials x^2 - a and x^3 - b x, orthogonal to 1 and x."""
    x = np.arange(side, dtype=np.float64) - side // 2
    return float((x**2).mean()), float((x**4).sum() / (x**2).sum())


@dataclass(frozen=True, slots=True)
class Facets:
    """The coefficients of each pixel's cubic, (height, width) float32, named by their powers.

    f(x, y) = ... + x x + y y + xx x^2 + xy x y + yy y^2 + xxx x^3 + xxy x^2 y + xyy x y^2 +
    yyy y^3, x to the right and y downwards from the pixel, in pixels.
    """

    x: Field
    y: Field
    xx: Field
    xy: Field
    yy: Field
    xxx: Field
    xxy: Field
    xyy: Field
    yyy: Field


def fit(picture: Gray, side: int) -> Facets:
    """Return the least-squares cubic of each pixel's window.

    At the border the picture continues with its outermost pixels.
    """
    lines = polynomials(side)
    a, b = fit_constants(side)

    def coefficient(power_x: int, power_y: int) -> Field:
        found = cv2.sepFilter2D(
            picture,
            cv2.CV_32F,
            lines[power_x],
            lines[power_y],
            borderType=cv2.BORDER_REPLICATE,
        )
        return np.asarray(found, np.float32)

    powers = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
    xx, xy, yy, xxx, xxy, xyy, yyy = starmap(coefficient, powers)
    x = coefficient(1, 0) - np.float32(b) * xxx - np.float32(a) * xyy
    y = coefficient(0, 1) - np.float32(b) * yyy - np.float32(a) * xxy
    return Facets(x, y, xx, xy, yy, xxx, xxy, xyy, yyy)


class HaralickDetection(Detection):
    """The edges of one picture by its facets, and the steps."""

    def __init__(self, detector: Haralick, picture: Gray) -> None:
        self._detector = detector
        self._picture = picture

    @cached_property
    def smoothed(self) -> Gray:
        """(height, width) uint8 after the Gaussian."""
        return smooth(self._picture, self._detector.sigma)

    @cached_property
    def facets(self) -> Facets:
        """The cubic of each pixel."""
        return fit(self.smoothed, self._detector.window)

    @cached_property
    def gradient(self) -> tuple[Field, Field, Field]:
        """Direction to the right and downwards, of length 1, and the slope of grey levels."""
        return unit_vectors(self.facets.x, self.facets.y)

    @cached_property
    def crossing(self) -> tuple[Field, Field]:
        """Distance along the gradient to the zero crossing, and the slope of grey levels there.

        Along the gradient the cubic is c1 t + c2 t^2 + c3 t^3. Its second derivative is 0 at
        t = -c2 / (3 c3), and the first is c1 - c2^2 / (3 c3) there: its maximum, if c3 < 0.
        """
        f, (u, v, c1) = self.facets, self.gradient
        c2 = f.xx * u * u + f.xy * u * v + f.yy * v * v
        c3 = (f.xxx * u + f.xxy * v) * u * u + (f.xyy * u + f.yyy * v) * v * v
        distance = distance_to_crossing(2 * c2, -6 * c3)
        near = np.where(np.isfinite(distance), distance, np.float32(0))
        return distance, c1 + c2 * near

    @cached_property
    def strength(self) -> Strength:
        """The gradient at each pixel of a zero crossing, else 0."""
        along_x, along_y, _ = self.gradient
        distance, slope = self.crossing
        kept = thin_crossings(distance, along_x, along_y) > 0
        return np.where(kept, slope * np.float32(SOBEL_GAIN), 0)

    @cached_property
    def edges(self) -> Gray:
        """(height, width) uint8, 0 or 255."""
        return np.where(self.strength > self._detector.high, np.uint8(255), np.uint8(0))

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The five steps; ``magnitude`` is the gradient at the pixel."""
        full, high = self._detector.full_scale, self._detector.high
        return {
            "smoothed": lambda: self.smoothed,
            "magnitude": self._magnitude,
            "direction": lambda: as_hue(*self.gradient[:2], self._magnitude()),
            "suppressed": lambda: as_gray(self.strength, full),
            "thresholded": lambda: in_two_grays(self.strength, high, high),
        }

    def _magnitude(self) -> Gray:
        return as_gray(self.gradient[2] * np.float32(SOBEL_GAIN), self._detector.full_scale)
