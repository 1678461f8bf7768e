"""Canny's edge detector after Gaussian smoothing."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def detect_edges(
    gray: NDArray[np.uint8], *, sigma: float, low: float, high: float, aperture: int, l2: bool
) -> NDArray[np.uint8]:
    """Return the edge map of a grey picture, 0 or 255.

    ``cv2.Canny`` does not smooth, which is essential for the quality, so it is done here.

    Args:
        gray: (height, width) uint8; not modified.
        sigma: Standard deviation of the Gaussian, pixels; 0 for no smoothing.
        low: Hysteresis threshold below which a gradient is no edge.
        high: Hysteresis threshold above which a gradient is an edge.
        aperture: Side of the Sobel kernel: 3, 5 or 7.
        l2: Compute the magnitude as sqrt(gx^2 + gy^2) instead of |gx| + |gy|.

    Source: J. Canny, "A Computational Approach to Edge Detection", 1986; the seed tutorial,
    "How the Canny Edge Detector Works", steps 1 to 4.
    """
    smoothed = gray if sigma == 0 else cv2.GaussianBlur(gray, (0, 0), sigma)
    edges = cv2.Canny(smoothed, low, high, apertureSize=aperture, L2gradient=l2)
    return np.asarray(edges, np.uint8)
