"""Zero crossings of the Laplacian of a Gaussian, with a threshold of their slope."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

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

CENTRAL = np.array([-0.5, 0, 0.5], np.float32)
ONE = np.ones(1, np.float32)


@dataclass(frozen=True, slots=True)
class LaplacianOfGaussian(Detector):
    """Marks where the Laplacian of the smoothed picture is 0 and falls towards the bright side.

    The slope there is given as the gradient of the ideal step that has it, so that ``high`` means
    the same as for the gradient operators: a step of h grey levels has the slope
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
        """The gradient of an ideal step, in the unit of the Sobel operator, over its slope."""
        return SOBEL_GAIN * self.sigma**2

    @property
    def full_scale(self) -> float:
        """A bound of the strength that 8-bit pixels can have."""
        rows = laplacian_kernel(self.sigma)
        differences = np.abs(np.apply_along_axis(np.convolve, 1, rows, CENTRAL)).sum()
        return float(255 / 2 * differences * 2**0.5 * self.slope_scale)

    @property
    def largest_response(self) -> float:
        """The largest Laplacian that 8-bit pixels can have."""
        return float(255 / 2 * np.abs(laplacian_kernel(self.sigma)).sum())

    def detect(self, picture: Picture) -> LaplacianDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return LaplacianDetection(self, picture)


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


def laplacian_kernel(sigma: float) -> NDArray[np.float64]:
    """Return the whole kernel of the Laplacian of a Gaussian, (side, side) float64."""
    gaussian, _, second = gaussian_kernels(sigma)
    return np.asarray(np.outer(gaussian, second) + np.outer(second, gaussian), np.float64)


class LaplacianDetection(Detection):
    """The edges of one picture by the Laplacian of a Gaussian, and the steps."""

    def __init__(self, detector: LaplacianOfGaussian, picture: Gray) -> None:
        self._detector = detector
        self._picture = picture

    def _filtered(self, along_x: Field, along_y: Field, picture: Picture | Field) -> Field:
        found = cv2.sepFilter2D(
            picture, cv2.CV_32F, along_x, along_y, borderType=cv2.BORDER_REPLICATE
        )
        return np.asarray(found, np.float32)

    @cached_property
    def smoothed(self) -> Gray:
        """(height, width) uint8 after the Gaussian; only to be shown, the rest is not rounded."""
        return smooth(self._picture, self._detector.sigma)

    @cached_property
    def response(self) -> Field:
        """The Laplacian of the smoothed picture, (height, width) float32, negative where bright.

        At the border the picture continues with its outermost pixels.
        """
        gaussian, _, second = gaussian_kernels(self._detector.sigma)
        wide = self._filtered(second, gaussian, self._picture)
        return wide + self._filtered(gaussian, second, self._picture)

    @cached_property
    def gradient(self) -> tuple[Field, Field, Field]:
        """Direction to the right and downwards, of length 1, and the slope of grey levels."""
        gaussian, first, _ = gaussian_kernels(self._detector.sigma)
        gx = self._filtered(first, gaussian, self._picture)
        return unit_vectors(gx, self._filtered(gaussian, first, self._picture))

    @cached_property
    def slope(self) -> Field:
        """How fast the Laplacian falls along the gradient, per pixel."""
        along_x, along_y, _ = self.gradient
        falls_x = self._filtered(CENTRAL, ONE, self.response)
        falls_y = self._filtered(ONE, CENTRAL, self.response)
        return -(falls_x * along_x + falls_y * along_y)

    @cached_property
    def strength(self) -> Strength:
        """The slope at each pixel of a zero crossing, as the gradient of an ideal step, else 0."""
        along_x, along_y, _ = self.gradient
        distance = distance_to_crossing(self.response, self.slope)
        kept = thin_crossings(distance, along_x, along_y) > 0
        return np.where(kept, self.slope * np.float32(self._detector.slope_scale), 0)

    @cached_property
    def edges(self) -> Gray:
        """(height, width) uint8, 0 or 255."""
        return np.where(self.strength > self._detector.high, np.uint8(255), np.uint8(0))

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The five steps; ``magnitude`` is the absolute value of the Laplacian."""
        full, high = self._detector.full_scale, self._detector.high
        return {
            "smoothed": lambda: self.smoothed,
            "magnitude": self._magnitude,
            "direction": lambda: as_hue(*self.gradient[:2], self._magnitude()),
            "suppressed": lambda: as_gray(self.strength, full),
            "thresholded": lambda: in_two_grays(self.strength, high, high),
        }

    def _magnitude(self) -> Gray:
        return as_gray(np.abs(self.response), self._detector.largest_response)
