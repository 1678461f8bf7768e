"""Thin lines where a second derivative changes its sign along the direction of the gradient.

The sign changes between pixels, so a pixel has no maximum that could be kept. Instead, the distance
to the change is estimated for each pixel by one step of Newton's method, and of the pixels along
the gradient the nearest one is kept.

The derivatives are a dozen numbers for each pixel, so a picture is worked on in strips of rows, and
only what is kept is as large as the picture.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Detector, Gray, Picture, Strength
from zv.edge.detectors.rendering import as_gray, as_hue, in_two_grays
from zv.edge.detectors.smoothing import SmoothedDetection
from zv.edge.detectors.thinning import maxima

Field = NDArray[np.float32]
"""(height, width) float32."""

FARTHEST: Final = 1.0
"""Distance from a pixel to the change of sign beyond which the pixel is no candidate, pixels."""

NEAREST: Final = 16_000
"""What a distance of 0 becomes in 16 bits."""

STRIP_PIXELS: Final = 1 << 18
"""Of a strip without its margins, unless these are larger."""


@dataclass(frozen=True, slots=True)
class Crossings:
    """Where a second derivative is 0, as seen from each pixel.

    Attributes:
        distance: To the change of sign along the gradient, pixels; infinite if there is none.
        along_x: The gradient's direction, as a vector of length 1, or 0 without a direction.
        along_y: The same, downwards.
        strength: Of the edge there, in the unit of ``high``.
        magnitude: What the step ``magnitude`` shows, 0 to ``largest_magnitude``.
    """

    distance: Field
    along_x: Field
    along_y: Field
    strength: Field
    magnitude: Field


class ZeroCrossingDetector(Detector):
    """A subclass takes the derivatives of a picture; all else follows from them.

    Attributes:
        smooths: ``crossings`` gets the picture after a Gaussian of ``sigma``.
        sigma: Standard deviation of that, or of the detector's own, Gaussian, pixels.
        high: Only strengths above it are edges, in the unit of the 3x3 Sobel operator.
    """

    smooths: ClassVar[bool] = False

    sigma: float
    high: float

    @property
    @abstractmethod
    def reach(self) -> int:
        """How many rows away a pixel has influence on ``crossings``."""

    @property
    def step(self) -> int:
        """Strips begin at multiples of so many rows."""
        return 1

    @property
    def largest_magnitude(self) -> float:
        """The largest magnitude that 8-bit pixels can have."""
        return self.full_scale

    @abstractmethod
    def crossings(self, picture: Gray) -> Crossings:
        """Return the crossings of some rows, which continue with their outermost pixels."""

    def detect(self, picture: Picture) -> ZeroCrossingDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return ZeroCrossingDetection(self, picture)


class ZeroCrossingDetection(SmoothedDetection[ZeroCrossingDetector]):
    """The edges of one picture where a second derivative is 0, and the steps."""

    @cached_property
    def strength(self) -> Strength:
        """The strength at each pixel of a zero crossing, else 0."""
        return self._of_strips(thin_strength)

    @cached_property
    def edges(self) -> Gray:
        """(height, width) uint8, 0 or 255."""
        return (self.strength > self._detector.high) * np.uint8(255)

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The five steps, each computed when it is called."""
        detector = self._detector
        return {
            "smoothed": lambda: self.smoothed,
            "magnitude": lambda: self._of_strips(self._magnitude),
            "direction": lambda: self._of_strips(self._direction),
            "suppressed": lambda: as_gray(self.strength, detector.full_scale),
            "thresholded": lambda: in_two_grays(self.strength, detector.high, detector.high),
        }

    def _magnitude(self, found: Crossings) -> Gray:
        return as_gray(found.magnitude, self._detector.largest_magnitude)

    def _direction(self, found: Crossings) -> Picture:
        return as_hue(found.along_x, found.along_y, self._magnitude(found))

    def _of_strips(self, work: Callable[[Crossings], NDArray[Any]]) -> NDArray[Any]:
        """Return what ``work`` makes of the crossings, (height, width[, channels])."""
        detector = self._detector
        source = self.smoothed if detector.smooths else self._picture
        height, width = source.shape
        # A row more, since a crossing is compared with its neighbours.
        margin = rounded_up(detector.reach + 1, detector.step)
        rows = rounded_up(max(STRIP_PIXELS // width, 2 * margin), detector.step)
        made: NDArray[Any] | None = None
        for top in range(0, height, rows):
            first = max(0, top - margin)
            strip = work(detector.crossings(source[first : top + rows + margin]))
            if made is None:
                made = np.empty((height, *strip.shape[1:]), strip.dtype)
            made[top : top + rows] = strip[top - first :][:rows]
        assert made is not None
        return made


def rounded_up(number: int, step: int) -> int:
    """Return the next multiple of ``step``."""
    return -(-number // step) * step


def thin_strength(found: Crossings) -> Strength:
    """Return strengths at the pixels that are nearest to a crossing along the gradient, else 0."""
    near = np.maximum(FARTHEST - np.abs(found.distance), 0) * np.float32(NEAREST / FARTHEST)
    gx, gy = (np.rint(near * along).astype(np.int16) for along in (found.along_x, found.along_y))
    return np.where(maxima(gx, gy, l2=True) > 0, found.strength, np.float32(0))


def distance_to_crossing(second: Field, slope: Field) -> Field:
    """Return how far along the gradient the second derivative is 0, pixels; infinite if nowhere.

    Args:
        second: Second derivative at each pixel.
        slope: How fast it falls along the gradient; only where it falls is there an edge, since
            the first derivative has a maximum there, and a minimum where it rises.
    """
    far = np.full_like(second, np.inf)
    return np.divide(second, slope, out=far, where=slope > 1e-6)


def unit_vectors(x: Field, y: Field) -> tuple[Field, Field, Field]:
    """Return vectors divided by their lengths, and the lengths; 0 stays 0."""
    length = np.asarray(np.sqrt(x * x + y * y), np.float32)
    scale = np.float32(1) / np.maximum(length, np.float32(1e-6))
    return np.asarray(x * scale, np.float32), np.asarray(y * scale, np.float32), length
