"""``Detector`` and ``Detection``: the interface of all edge detectors.

A detector is a frozen dataclass whose fields are its parameters. Its ``detect`` returns a
``Detection`` of one picture, which computes edge map, strength and stages on demand.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, ClassVar, Final, Generic, Literal, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.rendering import Gray, Picture, Strength, as_gray, as_hue, in_two_grays

STAGES: Final = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")
"""The names of a detector's steps, in order."""


class Detector(ABC):
    """Finds edges; a subclass is a frozen dataclass of its parameters.

    Attributes:
        wants: The form of the pictures that ``detect`` takes: ``gray`` (height, width) or ``bgr``
            (height, width, 3), uint8.
        sigma: Standard deviation of the Gaussian applied first, pixels; 0 for none.
        high: Only strengths above it are edges, in the unit of the 3x3 Sobel operator.
    """

    wants: ClassVar[Literal["gray", "bgr"]] = "gray"

    sigma: float
    high: float

    @property
    @abstractmethod
    def full_scale(self) -> float:
        """An upper bound of the strength in any picture; encoded as 65535 in 16 bits."""

    @property
    def hysteresis(self) -> tuple[float, float]:
        """Strengths above the second are edges, and those above the first that touch them."""
        return self.high, self.high

    def smoothed(self, picture: Picture) -> Gray:
        """Return the first step of a picture, (height, width) uint8: smoothed by the Gaussian.

        At the border the picture is mirrored without repeating the outermost pixels.
        """
        if self.sigma == 0:
            return picture
        return np.asarray(cv2.GaussianBlur(picture, (0, 0), self.sigma), np.uint8)

    @abstractmethod
    def detect(self, picture: Picture) -> Detection[Any]:
        """Return the detection of a picture, which is not modified; nothing is computed yet."""


Kind = TypeVar("Kind", bound=Detector)


class Detection(ABC, Generic[Kind]):
    """The result of a detector for one picture; each part is computed on first access.

    Subclasses use ``functools.cached_property``. Two threads that access a part at the same time
    may both compute it; they get equal results.
    """

    def __init__(self, detector: Kind, picture: Picture) -> None:
        self._detector = detector
        self._picture = picture

    @cached_property
    def smoothed(self) -> Gray:
        """The first step, (height, width) uint8."""
        return self._detector.smoothed(self._picture)

    @property
    @abstractmethod
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8: 255 on lines of one pixel's width, else 0."""

    @property
    @abstractmethod
    def strength(self) -> Strength:
        """The strength of each edge pixel after thinning and before any threshold, else 0.

        (height, width) float32, in the unit of the detector's thresholds.
        """

    @abstractmethod
    def shown_magnitude(self) -> Gray:
        """Return the strengths before thinning as grey."""

    @abstractmethod
    def shown_direction(self) -> Picture:
        """Return the directions across the edges as hue, (height, width, 3)."""

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The steps by their names, all of ``STAGES``; each call computes one picture.

        Pictures are uint8: (height, width) grey, or (height, width, 3) in BGR order.
        """
        return {
            "smoothed": lambda: self.smoothed,
            "magnitude": self.shown_magnitude,
            "direction": self.shown_direction,
            "suppressed": lambda: as_gray(self.strength, self._detector.full_scale),
            "thresholded": lambda: in_two_grays(self.strength, *self._detector.hysteresis),
        }


class GradientDetector(Detector):
    """Finds edges at the maxima of a gradient's magnitude along its direction.

    Attributes:
        l2: Whether the magnitude is sqrt(gx^2 + gy^2) instead of |gx| + |gy|.
    """

    l2: bool = True

    @property
    @abstractmethod
    def unit(self) -> float:
        """Strength of a gradient of 1."""


LONGEST: Final = 46340.0
"""No gradient with derivatives of 16 bits is longer; its square still fits into 32 bits."""

Gradual = TypeVar("Gradual", bound=GradientDetector)


class GradientDetection(Detection[Gradual]):
    """The edges of one picture at the maxima of a gradient, by OpenCV's own code, and its steps.

    The direction is rounded to horizontal, vertical or one of the diagonals. A pixel must exceed
    its left or upper neighbour and be at least its right or lower one, and exceed both on a
    diagonal. Outside of the picture the magnitude counts as 0. Where it is 0, there is no maximum.
    """

    @property
    @abstractmethod
    def gradient(self) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Derivatives to the right and downwards, (height, width) int16, in the detector's unit."""

    def thinned(self, low: float, high: float) -> Gray:
        """Return 255 at the maxima that two thresholds, in strengths, leave; else 0."""
        weak, strong = (each / self._detector.unit for each in (low, high))
        if self._detector.l2:  # on one thread, OpenCV squares them in 32 bits
            weak, strong = min(weak, LONGEST), min(strong, LONGEST)
        thin = cv2.Canny(*self.gradient, weak, strong, L2gradient=self._detector.l2)
        return np.asarray(thin, np.uint8)

    @cached_property
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8: 0 or 255."""
        return self.thinned(*self._detector.hysteresis)

    @cached_property
    def magnitude(self) -> Strength:
        """The gradient's magnitude, (height, width) float32."""
        gx, gy = (derivative.astype(np.float32) for derivative in self.gradient)
        # The last bit of cv2.magnitude depends on where the arrays lie in memory.
        size = np.sqrt(gx * gx + gy * gy) if self._detector.l2 else np.abs(gx) + np.abs(gy)
        return np.asarray(size * np.float32(self._detector.unit), np.float32)

    @cached_property
    def strength(self) -> Strength:
        """The magnitude where it is a maximum along the gradient's direction, else 0."""
        return np.where(self.thinned(0, 0) > 0, self.magnitude, np.float32(0))

    def shown_magnitude(self) -> Gray:
        """Return the magnitude as grey."""
        return as_gray(self.magnitude, self._detector.full_scale)

    def shown_direction(self) -> Picture:
        """Return the gradient's direction as hue."""
        return as_hue(*self.gradient, self.shown_magnitude())
