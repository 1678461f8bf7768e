"""Zero crossings of the Laplacian of a Gaussian, with a threshold for their slope."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

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

CENTRAL = np.array([-0.5, 0, 0.5], np.float32)
ONE = np.ones(1, np.float32)

LEAST_REDUCED_SIGMA: Final = 4.0
"""Before a wide Gaussian, a picture is reduced, since the smoothed result needs fewer samples. The
Gaussian's sigma stays at least this large, in pixels of the reduced picture."""


@dataclass(frozen=True, slots=True)
class LaplacianOfGaussian(ZeroCrossingDetector):
    """Finds where the Laplacian of the smoothed picture crosses 0, falling to the bright side.

    The Laplacian's slope there is converted to the gradient of an ideal step, so that
    ``high`` means the same as for the gradient operators: a step of h grey levels has the slope
    h / (sqrt(2 pi) sigma^3) and the gradient h / (sqrt(2 pi) sigma) per pixel.

    Source: D. Marr and E. Hildreth, "Theory of Edge Detection", 1980.

    Attributes:
        sigma: Standard deviation of the Gaussian, pixels; at least 0.5, below which the pixels
            do not sample its second derivative.
        high: Only slopes above it are edges, in the unit of the 3x3 Sobel operator.
    """

    sigma: float = 1.4
    high: float = 100.0

    @property
    def slope_scale(self) -> float:
        """Gradient of an ideal step, in the unit of the Sobel operator, divided by its slope."""
        return SOBEL_GAIN * self.sigma**2

    @property
    def full_scale(self) -> float:
        """An upper bound of the strength that 8-bit pixels can have."""
        return largest_responses(self.sigma)[1] * self.slope_scale

    @property
    def largest_magnitude(self) -> float:
        """The largest Laplacian that 8-bit pixels can have."""
        return largest_responses(self.sigma)[0]

    @property
    def reach(self) -> int:
        """The radius of the Gaussian plus that of the interpolation plus one row for the slope."""
        return int(4 * self.sigma + 0.5) + 4 * self.step + 1

    @property
    def step(self) -> int:
        """The factor by which the picture is reduced."""
        return reduction(self.sigma)

    def crossings(self, picture: Gray) -> Crossings:
        """Return the crossings; ``magnitude`` is the absolute value of the Laplacian."""
        response, gx, gy = derivatives(picture, self.sigma)
        along_x, along_y, _ = unit_vectors(gx, gy)
        falls_x = filtered(response, CENTRAL, ONE)
        falls_y = filtered(response, ONE, CENTRAL)
        slope = -(falls_x * along_x + falls_y * along_y)
        return Crossings(
            distance_to_crossing(response, slope),
            along_x,
            along_y,
            strength=slope * np.float32(self.slope_scale),
            magnitude=np.abs(response),
        )


def reduction(sigma: float) -> int:
    """Return the factor by which a picture is reduced for a Gaussian."""
    return max(1, int(sigma / LEAST_REDUCED_SIGMA))


def derivatives(picture: Gray, sigma: float) -> tuple[Field, Field, Field]:
    """Return the Laplacian and the gradient of a picture smoothed by a Gaussian.

    With a large ``sigma``, they are computed from the picture reduced by averaging blocks of
    pixels, with a Gaussian that is narrower by the blocks' variance, and then interpolated. The
    time therefore does not grow with ``sigma``.

    Args:
        picture: (height, width) uint8; at the border, the outermost pixels are replicated.
        sigma: Standard deviation, pixels.

    Returns:
        The Laplacian, negative where bright, and the derivatives to the right and downwards;
        (height, width) float32.
    """
    factor = reduction(sigma)
    inner = (sigma**2 - (factor**2 - 1) / 12) ** 0.5 / factor
    if factor == 1:
        return _derivatives(picture, inner)
    height, width = picture.shape
    around = factor * (int(4 * inner) + 2)  # replicated before averaging, not after it
    down, right = -height % factor, -width % factor
    whole = cv2.copyMakeBorder(
        picture, around, around + down, around, around + right, cv2.BORDER_REPLICATE
    )
    size = whole.shape[1] // factor, whole.shape[0] // factor
    reduced = cv2.resize(whole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    found = _derivatives(np.asarray(reduced, np.float32), inner)
    part = slice(around, around + height), slice(around, around + width)
    laplacian, gx, gy = (
        np.asarray(cv2.resize(each, whole.shape[1::-1], interpolation=cv2.INTER_LANCZOS4)[part])
        for each in found
    )
    unit = np.float32(1 / factor)
    return laplacian * (unit * unit), gx * unit, gy * unit


def _derivatives(picture: Gray | Field, sigma: float) -> tuple[Field, Field, Field]:
    gaussian, first, second = gaussian_kernels(sigma)
    return (
        filtered(picture, second, gaussian) + filtered(picture, gaussian, second),
        filtered(picture, first, gaussian),
        filtered(picture, gaussian, first),
    )


def filtered(picture: Gray | Field, along_x: Field, along_y: Field) -> Field:
    """Return the correlation with a separable kernel, float32."""
    found = cv2.sepFilter2D(picture, cv2.CV_32F, along_x, along_y, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(found, np.float32)


@lru_cache(maxsize=4)
def gaussian_kernels(
    sigma: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return a Gaussian, its first and its second derivative, cut off at 4 sigma, float32.

    They are to be correlated with the picture, so the first has the sign of its position.
    """
    radius = int(4 * sigma + 0.5)
    x = np.arange(-radius, radius + 1, dtype=np.float64)
    gaussian = np.exp(-(x**2) / (2 * sigma**2))
    gaussian /= gaussian.sum()
    first = gaussian * x / sigma**2
    second = gaussian * (x**2 / sigma**4 - 1 / sigma**2)
    return (
        gaussian.astype(np.float32),
        first.astype(np.float32),
        second.astype(np.float32),
    )


@lru_cache(maxsize=4)
def largest_responses(sigma: float) -> tuple[float, float]:
    """Return the largest Laplacian of 8-bit pixels, and an upper bound of its slope per pixel."""
    gaussian, _, second = gaussian_kernels(sigma)
    rows = np.outer(gaussian, second) + np.outer(second, gaussian)
    differences = cv2.filter2D(np.pad(rows, 1), -1, CENTRAL[None], borderType=cv2.BORDER_CONSTANT)
    return (
        float(255 / 2 * np.abs(rows).sum()),
        float(255 / 2 * np.abs(differences).sum() * 2**0.5),
    )
