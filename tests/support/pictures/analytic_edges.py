"""Pictures of an edge whose position is known to a fraction of a pixel, and how far a map is off.

A step through the middle of the picture, in any direction: each pixel is the mean over its area,
as a sensor integrates it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

SIDE = 96
OVERSAMPLING = 8
INNER_RADIUS = 38
"""Of the circle that is judged: outside of it, the picture's border matters."""
NEAR = 3.0
"""Edge pixels farther from the edge, in pixels, are false."""


@dataclass(frozen=True)
class Step:
    """An edge: ``x cos(angle) + y sin(angle) = offset`` from the middle, bright on the far side."""

    degrees: float
    offset: float

    def distance(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        angle = np.deg2rad(self.degrees)
        return x * np.cos(angle) + y * np.sin(angle) - self.offset

    def picture(self, noise: float = 0.0, seed: int = 0, low: float = 60, high: float = 160):
        """Return (SIDE, SIDE) uint8 with normal noise of so many grey levels."""
        fine = (np.arange(SIDE * OVERSAMPLING) + 0.5) / OVERSAMPLING - 0.5 - (SIDE - 1) / 2
        bright = self.distance(*np.meshgrid(fine, fine)) > 0
        share = bright.reshape(SIDE, OVERSAMPLING, SIDE, OVERSAMPLING).mean((1, 3))
        noisy = low + (high - low) * share
        noisy += np.random.default_rng(seed).normal(0, noise, noisy.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Judged:
    """What an edge map says about a step.

    Attributes:
        errors: Distance of each edge pixel near the step from it, pixels; positive on the bright
            side.
        false: Number of other edge pixels in the circle.
        missed: Share of the step's length without an edge pixel within 2 pixels.
        blocks: Number of squares of 2x2 edge pixels: a thin line has none.
    """

    errors: NDArray[np.float64]
    false: int
    missed: float
    blocks: int


def judge(step: Step, edges: NDArray[np.uint8]) -> Judged:
    middle = (SIDE - 1) / 2
    x, y = np.meshgrid(np.arange(SIDE) - middle, np.arange(SIDE) - middle)
    distance = step.distance(x, y)
    found = (edges > 0) & (np.hypot(x, y) < INNER_RADIUS)
    near = found & (np.abs(distance) < NEAR)
    angle = np.deg2rad(step.degrees)
    along = np.arange(-INNER_RADIUS + 2, INNER_RADIUS - 1)
    on_x = np.rint(middle + step.offset * np.cos(angle) - along * np.sin(angle)).astype(int)
    on_y = np.rint(middle + step.offset * np.sin(angle) + along * np.cos(angle)).astype(int)
    to_edge = cv2.distanceTransform((edges == 0).astype(np.uint8), cv2.DIST_L2, 5)
    blocks = near[1:, 1:] & near[1:, :-1] & near[:-1, 1:] & near[:-1, :-1]
    return Judged(
        errors=distance[near],
        false=int((found & ~near).sum()),
        missed=float((to_edge[on_y, on_x] > 2).mean()),
        blocks=int(blocks.sum()),
    )
