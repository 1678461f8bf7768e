"""Non-maximum suppression and hysteresis, the two steps of Canny's detector that others share.

Suppression is done by OpenCV's own code, so that the step shown is the one of ``cv2.Canny``.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Gray


def maxima(gx: NDArray[np.int16], gy: NDArray[np.int16], *, l2: bool) -> Gray:
    """Return 255 at maxima of the magnitude along the gradient, else 0: non-maximum suppression.

    The direction is rounded to horizontal, vertical or one of the diagonals. A pixel must exceed
    its left or upper neighbour and be at least its right or lower one, and exceed both on a
    diagonal. Outside of the picture the magnitude counts as 0. Where it is 0, there is no maximum.

    Args:
        gx: (height, width) int16, derivative to the right.
        gy: The same, downwards.
        l2: Whether the magnitude is sqrt(gx^2 + gy^2), else |gx| + |gy|.
    """
    return np.asarray(cv2.Canny(gx, gy, 0, 0, L2gradient=l2), np.uint8)


def hysteresis(weak: NDArray[np.bool_], strong: NDArray[np.bool_]) -> Gray:
    """Return 255 at weak pixels that are 8-connected, through weak ones, to a strong one, else 0.

    Args:
        weak: (height, width); includes ``strong``.
        strong: (height, width).
    """
    count, labels = cv2.connectedComponents(weak.view(np.uint8), connectivity=8)
    kept = np.zeros(count, np.uint8)
    kept[labels[strong]] = 255
    kept[0] = 0
    return np.asarray(kept[labels], np.uint8)
