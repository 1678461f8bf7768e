"""Thin lines where a second derivative changes its sign along the direction of the gradient.

The sign changes between pixels, so a pixel has no maximum that could be kept. Instead, the distance
to the change is estimated for each pixel by one step of Newton's method, and of the pixels along
the gradient the nearest one is kept.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Gray
from zv.edge.detectors.thinning import maxima

Field = NDArray[np.float32]
"""(height, width) float32."""

FARTHEST: Final = 1.0
"""Distance from a pixel to the change of sign beyond which the pixel is no candidate, pixels."""

NEAREST: Final = 16_000
"""What a distance of 0 becomes in 16 bits."""


def distance_to_crossing(second: Field, slope: Field) -> Field:
    """Return how far along the gradient the second derivative is 0, pixels; infinite if nowhere.

    Args:
        second: Second derivative at each pixel.
        slope: How fast it falls along the gradient; only where it falls is there an edge, since
            the first derivative has a maximum there, and a minimum where it rises.
    """
    far = np.full_like(second, np.inf)
    return np.divide(second, slope, out=far, where=slope > 1e-6)


def thin_crossings(distance: Field, along_x: Field, along_y: Field) -> Gray:
    """Return 255 at the pixels that are nearest to a change of sign along the gradient, else 0.

    Args:
        distance: From each pixel along the gradient, pixels.
        along_x: The gradient's direction, as a vector of length 1, or 0 without a direction.
        along_y: The same, downwards.
    """
    near = np.maximum(FARTHEST - np.abs(distance), 0) * np.float32(NEAREST / FARTHEST)
    gx, gy = (np.rint(near * along).astype(np.int16) for along in (along_x, along_y))
    return maxima(gx, gy, l2=True)


def unit_vectors(x: Field, y: Field) -> tuple[Field, Field, Field]:
    """Return vectors divided by their lengths, and the lengths; 0 stays 0."""
    length = np.asarray(np.sqrt(x * x + y * y), np.float32)
    scale = np.float32(1) / np.maximum(length, np.float32(1e-6))
    return np.asarray(x * scale, np.float32), np.asarray(y * scale, np.float32), length
