"""Thin lines at the zero crossings of a second derivative along the direction of the gradient.

A zero crossing lies between pixels, so no pixel has a maximum to be kept. Instead, each pixel's
distance to the zero crossing is estimated by one step of Newton's method, and the nearest of the
pixels along the gradient is kept.

The derivatives need a dozen numbers per pixel. A picture is therefore processed in strips of rows,
and only the results have the size of the picture.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Detection, Detector
from zv.edge.detectors.rendering import Gray, Picture, Strength, as_gray, as_hue

Field = NDArray[np.float32]
"""(height, width) float32."""

MAX_DISTANCE: Final = 1.0
"""Largest distance of a pixel from the zero crossing, pixels."""

NEAREST: Final = 16_000
"""The 16-bit integer that stands for a distance of 0."""

STRIP_PIXELS: Final = 1 << 18
"""Number of pixels of a strip without its margins; more if the margins are larger."""


@dataclass(frozen=True, slots=True)
class Crossings:
    """The zero crossing of a second derivative near each pixel; arrays of (height, width) float32.

    Attributes:
        distance: Distance to the zero crossing along the gradient, pixels; infinite without one.
        along_x: Component to the right of the gradient's unit vector; 0 without a gradient.
        along_y: Component downwards of the same vector.
        strength: Strength of the edge at the crossing, in the unit of ``high``.
        magnitude: The values of the step ``magnitude``, 0 to ``largest_magnitude``.
    """

    distance: Field
    along_x: Field
    along_y: Field
    strength: Field
    magnitude: Field


class ZeroCrossingDetector(Detector):
    """Finds edges at zero crossings, which a subclass computes from the derivatives of a picture.

    Attributes:
        smooths: Whether ``crossings`` gets the picture smoothed by a Gaussian of ``sigma``; else
            the subclass smooths it.
    """

    smooths: ClassVar[bool] = False

    @property
    @abstractmethod
    def reach(self) -> int:
        """Number of rows by which a pixel may be away and still influence ``crossings``."""

    @property
    def step(self) -> int:
        """Strips begin at multiples of this number of rows."""
        return 1

    @property
    def largest_magnitude(self) -> float:
        """The largest magnitude that 8-bit pixels can have."""
        return self.full_scale

    @abstractmethod
    def crossings(self, picture: Gray) -> Crossings:
        """Return the crossings of a strip of rows; its border pixels are replicated outside."""

    def detect(self, picture: Picture) -> ZeroCrossingDetection:
        """Return the edges of a grey picture, (height, width) uint8."""
        return ZeroCrossingDetection(self, picture)


class ZeroCrossingDetection(Detection[ZeroCrossingDetector]):
    """The edges of one picture at zero crossings, and its steps."""

    @cached_property
    def strength(self) -> Strength:
        """The strength at each pixel of a zero crossing, else 0."""
        return self._of_strips(thin_strength)

    @cached_property
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8, 0 or 255."""
        return (self.strength > self._detector.high) * np.uint8(255)

    def shown_magnitude(self) -> Gray:
        """Return the magnitudes of the crossings as grey."""
        return self._of_strips(self._magnitude)

    def shown_direction(self) -> Picture:
        """Return the directions of the crossings as hue."""
        return self._of_strips(
            lambda found: as_hue(found.along_x, found.along_y, self._magnitude(found))
        )

    def _magnitude(self, found: Crossings) -> Gray:
        return as_gray(found.magnitude, self._detector.largest_magnitude)

    def _of_strips(self, work: Callable[[Crossings], NDArray[Any]]) -> NDArray[Any]:
        """Apply ``work`` to the crossings, strip by strip; return (height, width[, channels])."""
        detector = self._detector
        source = self.smoothed if detector.smooths else self._picture
        height, width = source.shape
        # One more row, since a crossing is compared with its neighbours.
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
    """Return a number rounded up to a multiple of ``step``."""
    return -(-number // step) * step


def thin_strength(found: Crossings) -> Strength:
    """Return strengths at the pixels that are nearest to a crossing along the gradient, else 0."""
    near = np.maximum(MAX_DISTANCE - np.abs(found.distance), 0) * np.float32(NEAREST / MAX_DISTANCE)
    gx, gy = (np.rint(near * along).astype(np.int16) for along in (found.along_x, found.along_y))
    nearest = np.asarray(cv2.Canny(gx, gy, 0, 0, L2gradient=True))  # non-maximum suppression
    return np.where(nearest > 0, found.strength, np.float32(0))


def distance_to_crossing(second: Field, slope: Field) -> Field:
    """Return the distance along the gradient to a zero of the second derivative, pixels.

    Args:
        second: Second derivative at each pixel, (height, width).
        slope: Rate at which it falls along the gradient, (height, width).

    Returns:
        (height, width); infinite where the second derivative does not fall: the first derivative
        has a maximum, which is an edge, only where it falls.
    """
    far = np.full_like(second, np.inf)
    return np.divide(second, slope, out=far, where=slope > 1e-6)


def unit_vectors(x: Field, y: Field) -> tuple[Field, Field, Field]:
    """Return vectors divided by their lengths, and the lengths; a vector of 0 stays 0."""
    length = np.asarray(np.sqrt(x * x + y * y), np.float32)
    scale = np.float32(1) / np.maximum(length, np.float32(1e-6))
    return np.asarray(x * scale, np.float32), np.asarray(y * scale, np.float32), length
