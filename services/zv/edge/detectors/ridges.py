"""Thin lines along the ridges of a map of boundary strengths, of half the picture's size or less.

``colour`` and ``learned`` estimate the probability of a boundary at each pixel of a reduced
picture. Lines are the ridges of that map. Non-maximum suppression works across the ridge, whose
direction follows from the map's second derivatives. The picture's gradient is not used, since it is
noisy where strengths come from several scales.

There is one threshold and no hysteresis, since hysteresis adds hardly any boundary that people
would draw, and makes whole lines appear and disappear in a video.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import GradientDetection, GradientDetector
from zv.edge.detectors.rendering import Gray, Picture, Strength

Integers = NDArray[np.int16]
"""(height, width)."""

INTEGERS: Final = 30000
"""The integer that stands for strength 1 in 16 bits."""


def half_size(picture: Picture) -> Picture:
    """Return a picture at half its size, rounded up, each pixel the mean of those it covers."""
    height, width = picture.shape[:2]
    size = ((width + 1) // 2, (height + 1) // 2)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def across(strength: Strength, sigma: float) -> tuple[Strength, Strength]:
    """Return the unit direction across the ridge at each pixel of a map of strengths.

    It is the eigenvector of the smoothed map's second derivatives with the smaller eigenvalue,
    along which the map falls off fastest. It points to the right, or straight down.

    Args:
        strength: (height, width) float32.
        sigma: Standard deviation of the Gaussian before the derivatives, pixels of the map.

    Returns:
        The components to the right and downwards, (height, width) float32.
    """
    smooth = cv2.GaussianBlur(strength, (0, 0), sigma)
    xx, yy, xy = (
        cv2.Sobel(smooth, cv2.CV_32F, *orders, ksize=3) for orders in ((2, 0), (0, 2), (1, 1))
    )
    twice = cv2.phase(yy - xx, -2 * xy)  # of the doubled angle, 0 to 2 pi
    right, down = cv2.polarToCart(np.ones_like(twice), twice * np.float32(0.5))
    return np.asarray(right, np.float32), np.asarray(down, np.float32)


def enlarged(values: Integers, shape: tuple[int, ...]) -> Integers:
    """Enlarge a map to (height, width) by repeating the pixel that each new pixel lies in.

    It takes half the time of ``cv2.resize`` with the nearest pixel.
    """
    rows, columns = (
        np.arange(new) * own // new for new, own in zip(shape, values.shape, strict=True)
    )
    larger: Integers = values.take(columns, axis=1).take(rows, axis=0)
    return larger


def in_integers(values: Strength) -> Integers:
    """Return numbers from -1 to 1 as integers from ``-INTEGERS`` to ``INTEGERS``."""
    return (values * np.float32(INTEGERS)).astype(np.int16)


@dataclass(frozen=True, slots=True)
class RidgeDetector(GradientDetector):
    """Finds edges as ridges of a map of strengths from 0 to 1, which a subclass computes.

    Attributes:
        thresholds: The thresholds at which ridges are 0, 1, 2, ... percent of the pixels, on
            average over BSDS500's training images; falling.
        density: Wanted share of edge pixels, percent of an average picture. It selects a fixed
            threshold, so a plain wall has fewer edges and a tree has more.
        margin: Width of the margin without edges around a picture, pixels, at most a sixteenth of
            its smaller side: a network responds to the end of the picture itself.
        smoothing: Standard deviation of the Gaussian that smooths the map before thinning, pixels
            of the map; a smaller one keeps more of the lines that are close together.
        ridge_sigma: Standard deviation of the Gaussian before the ridges' directions are
            computed, pixels of the map.
    """

    density: float = 3.5

    wants: ClassVar = "bgr"
    unit: ClassVar = 1 / INTEGERS
    margin: ClassVar[int] = 0
    smoothing: ClassVar[float]
    ridge_sigma: ClassVar[float]
    thresholds: ClassVar[Sequence[float]]

    @property
    def full_scale(self) -> float:
        """The largest possible strength, 1."""
        return 1.0

    @property
    def hysteresis(self) -> tuple[float, float]:
        """The strength above which a ridge is an edge, twice."""
        threshold = np.interp(self.density, np.arange(len(self.thresholds)), self.thresholds)
        return float(threshold), float(threshold)

    @abstractmethod
    def strengths(self, picture: Picture) -> Strength:
        """Return the strengths of a picture in BGR at a reduced size: float32, 0 to 1."""

    @abstractmethod
    def seen(self, picture: Picture) -> Picture:
        """Return the reduced picture from which ``strengths`` are computed, BGR, of any size."""

    def smoothed(self, picture: Picture) -> Gray:
        """Return the reduced picture that is used, in grey, enlarged to the picture's size."""
        seen = cv2.cvtColor(self.seen(picture), cv2.COLOR_BGR2GRAY)
        size = picture.shape[1::-1]
        return np.asarray(cv2.resize(seen, size, interpolation=cv2.INTER_LINEAR), np.uint8)

    def detect(self, picture: Picture) -> RidgeDetection:
        """Return the edges of a picture in BGR, (height, width, 3) uint8."""
        return RidgeDetection(self, picture)


class RidgeDetection(GradientDetection[RidgeDetector]):
    """The edges of one picture as the ridges of its map of strengths, and its steps.

    The gradient is the strength times the direction across the ridge.
    """

    @cached_property
    def gradient(self) -> tuple[Integers, Integers]:
        """The components to the right and downwards, (height, width) int16."""
        strength = self._detector.strengths(self._picture)
        size = self._picture.shape[1::-1]
        full = cv2.resize(in_integers(strength), size, interpolation=cv2.INTER_LINEAR)
        # Bilinear interpolation has maxima at every other pixel, which gives broken lines.
        sigma = size[0] / strength.shape[1] * self._detector.smoothing
        side = 2 * round(2 * sigma) + 1
        full = cv2.GaussianBlur(full, (side, side), sigma)
        gx, gy = (
            cv2.multiply(
                full,
                # Opposite directions are equivalent, so they must not be averaged.
                enlarged(in_integers(component), full.shape),
                scale=1 / INTEGERS,
                dtype=cv2.CV_16S,
            )
            for component in across(strength, self._detector.ridge_sigma)
        )
        return np.asarray(gx, np.int16), np.asarray(gy, np.int16)

    def thinned(self, low: float, high: float) -> Gray:
        """Return 255 on ridges above a threshold, but in the margin; else 0."""
        thin = super().thinned(low, high)
        margin = min(self._detector.margin, min(thin.shape) // 16)
        if margin > 0:
            thin[:margin] = thin[-margin:] = 0
            thin[:, :margin] = thin[:, -margin:] = 0
        return thin
