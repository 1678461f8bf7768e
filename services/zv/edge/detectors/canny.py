"""Canny's edge detector with Gaussian smoothing, by one call of OpenCV and in single steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Detector, Gray, Picture, Strength
from zv.edge.detectors.rendering import as_gray, as_hue, in_two_grays
from zv.edge.detectors.smoothing import SmoothedDetection
from zv.edge.detectors.thinning import hysteresis, maxima

ONE_SIDED_GAIN: Final = {3: 4, 5: 48, 7: 640}
"""The sum of the positive weights of a Sobel kernel, by its side."""

GAIN_DIVISOR: Final = {3: 1, 5: 1, 7: 16}
"""``cv2.Canny`` divides gradient and thresholds by this, so that 16 bits hold the gradient."""

LARGEST_L2_THRESHOLD: Final = 32767
"""With ``l2``, ``cv2.Canny`` limits thresholds to this value, after that division."""


@dataclass(frozen=True, slots=True)
class Canny(Detector):
    """Canny's detector: smoothing, gradient, non-maximum suppression, hysteresis.

    The picture is smoothed here, since the quality depends on it and ``cv2.Canny`` does not smooth.

    Source: J. Canny, "A Computational Approach to Edge Detection", 1986; the seed tutorial,
    "How the Canny Edge Detector Works", steps 1 to 4.

    Attributes:
        sigma: Standard deviation of the Gaussian, pixels; 0 for no smoothing.
        low: Hysteresis threshold: only gradients above it can be edges.
        high: Gradients above it are edges; at least ``low``.
        aperture: Side of the Sobel kernel: 3, 5 or 7.
        l2: The magnitude is sqrt(gx^2 + gy^2) instead of |gx| + |gy|.
    """

    sigma: float = 1.4
    low: float = 40.0
    high: float = 100.0
    aperture: int = 3
    l2: bool = True

    @property
    def full_scale(self) -> float:
        """An upper bound of the gradient magnitude of 8-bit pixels."""
        return 255 * ONE_SIDED_GAIN[self.aperture] * (2**0.5 if self.l2 else 2)

    def detect(self, picture: Picture) -> CannyDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return CannyDetection(self, picture)


class CannyDetection(SmoothedDetection[Canny]):
    """The edges of one picture, by ``cv2.Canny`` itself, and its steps.

    The steps are computed separately from the edge map, and only on demand. Hysteresis of
    ``suppressed`` gives the same edge map, bit for bit (``edges_by_steps``).
    """

    @cached_property
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8, 0 or 255."""
        canny = self._detector
        edges = cv2.Canny(
            self.smoothed,
            canny.low,
            canny.high,
            apertureSize=canny.aperture,
            L2gradient=canny.l2,
        )
        return np.asarray(edges, np.uint8)

    @cached_property
    def gradient(self) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Derivatives to the right and downwards, (height, width) int16.

        At the border the picture continues with its outermost pixels. 8-bit pixels give at most
        1020 with aperture 3, 12240 with 5 and 10200 with 7, divided by 16: nothing saturates.
        """
        side = self._detector.aperture
        scale = 1 / GAIN_DIVISOR[side]
        gx, gy = (
            cv2.Sobel(
                self.smoothed,
                cv2.CV_16S,
                *orders,
                ksize=side,
                scale=scale,
                borderType=cv2.BORDER_REPLICATE,
            )
            for orders in ((1, 0), (0, 1))
        )
        return np.asarray(gx, np.int16), np.asarray(gy, np.int16)

    @cached_property
    def magnitude(self) -> Strength:
        """The gradient's magnitude, (height, width) float32, in the unit of the thresholds."""
        gx, gy = (derivative.astype(np.float32) for derivative in self.gradient)
        size = cv2.magnitude(gx, gy) if self._detector.l2 else np.abs(gx) + np.abs(gy)
        return np.asarray(size * np.float32(GAIN_DIVISOR[self._detector.aperture]), np.float32)

    @cached_property
    def strength(self) -> Strength:
        """The magnitude where it is a maximum along the gradient's direction, else 0."""
        return np.where(maxima(*self.gradient, l2=self._detector.l2) > 0, self.magnitude, 0)

    @cached_property
    def edges_by_steps(self) -> Gray:
        """The edge map from the last step, equal to ``edges`` bit for bit.

        Integers are compared, as in ``cv2.Canny``: the thresholds' squares with ``l2``.
        """
        canny, (gx, gy) = self._detector, self.gradient
        low, high = (value / GAIN_DIVISOR[canny.aperture] for value in (canny.low, canny.high))
        x, y = gx.astype(np.int64), gy.astype(np.int64)
        if canny.l2:
            low, high = (min(value, LARGEST_L2_THRESHOLD) ** 2 for value in (low, high))
            size = x * x + y * y
        else:
            size = np.abs(x) + np.abs(y)
        thin = self.strength > 0
        weak, strong = (thin & (size > np.floor(value)) for value in (low, high))
        return hysteresis(weak, strong)

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The five steps, each computed when it is called."""
        return {
            "smoothed": lambda: self.smoothed,
            "magnitude": lambda: as_gray(self.magnitude, self._detector.full_scale),
            "direction": self._direction,
            "suppressed": lambda: as_gray(self.strength, self._detector.full_scale),
            "thresholded": lambda: in_two_grays(
                self.strength, self._detector.low, self._detector.high
            ),
        }

    def _direction(self) -> Picture:
        return as_hue(*self.gradient, as_gray(self.magnitude, self._detector.full_scale))
