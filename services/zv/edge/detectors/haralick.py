"""Zero crossings of the second directional derivative of a cubic facet model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import starmap
from typing import ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.gradient import SOBEL_GAIN
from zv.edge.detectors.rendering import Gray
from zv.edge.detectors.zero_crossings import (
    Crossings,
    Field,
    ZeroCrossingDetector,
    distance_to_crossing,
    unit_vectors,
)


@dataclass(frozen=True, slots=True)
class Haralick(ZeroCrossingDetector):
    """Fits a cubic polynomial to the window of each pixel and takes its derivatives.

    Source: R. M. Haralick, "Digital Step Edges from Zero Crossing of Second Directional
    Derivatives", 1984.

    Attributes:
        sigma: Standard deviation of the Gaussian applied first, pixels; 0 for none, as in the
            paper.
        high: Only zero crossings with a gradient above it are edges, in the unit of the 3x3 Sobel
            operator.
        window: Side of the window, pixels: 5, 7, 9 or 11.
    """

    smooths: ClassVar = True

    sigma: float = 1.4
    high: float = 100.0
    window: int = 5

    @property
    def full_scale(self) -> float:
        """An upper bound of the gradient at a pixel; larger extrapolated ones are clipped."""
        one, line, square, cube = polynomials(self.window)
        a, b = fit_constants(self.window)
        kernel = np.outer(one, line) - b * np.outer(one, cube) - a * np.outer(square, line)
        return float(255 / 2 * np.abs(kernel).sum() * 2**0.5 * SOBEL_GAIN)

    @property
    def reach(self) -> int:
        """Half of the window, rows."""
        return self.window // 2

    def crossings(self, picture: Gray) -> Crossings:
        """Return the crossings of the cubic of each pixel; ``magnitude`` is its gradient."""
        return crossings_of(fit(picture, self.window))


@cache
def polynomials(side: int) -> tuple[NDArray[np.float32], ...]:
    """Return the weights that fit polynomials of degree 0 to 3 to a line of pixels, float32.

    They are the values of the discrete orthogonal polynomials 1, x, x^2 - a and x^3 - b x, each
    divided by its sum of squares. Their correlation with a line of pixels gives the least-squares
    coefficients.
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
    """Fit a cubic to each pixel's window by least squares.

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


def crossings_of(facets: Facets) -> Crossings:
    """Return the zero crossings of the cubics' second derivatives along their gradients.

    Along the gradient the cubic is c1 t + c2 t^2 + c3 t^3. Its second derivative is 0 at
    t = -c2 / (3 c3). There the first derivative is c1 - c2^2 / (3 c3), a maximum if c3 < 0.
    """
    f = facets
    u, v, c1 = unit_vectors(f.x, f.y)
    c2 = f.xx * u * u + f.xy * u * v + f.yy * v * v
    c3 = (f.xxx * u + f.xxy * v) * u * u + (f.xyy * u + f.yyy * v) * v * v
    distance = distance_to_crossing(2 * c2, -6 * c3)
    near = np.where(np.isfinite(distance), distance, np.float32(0))
    gain = np.float32(SOBEL_GAIN)
    return Crossings(distance, u, v, strength=(c1 + c2 * near) * gain, magnitude=c1 * gain)
