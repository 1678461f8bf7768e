"""The tutorial's drawing: box, dot and coordinates on the frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.largest import MovingObject

GREEN = (0, 255, 0)


def draw(bgr: NDArray[np.uint8], found: MovingObject | None) -> NDArray[np.uint8]:
    """Return the frame with the object marked; the frame itself when nothing moves.

    Args:
        bgr: (height, width, 3) uint8; not modified.
        found: What moves, or None.

    Source: seed tutorial, "Real-Time Object Tracking", drawing step.
    """
    if found is None:
        return bgr
    picture = bgr.copy()
    x, y, width, height = found.box
    center_x, center_y = found.center
    cv2.rectangle(picture, (x, y), (x + width, y + height), GREEN, 3)
    cv2.circle(picture, (center_x, center_y), 4, GREEN, -1)
    cv2.putText(
        picture,
        f"x: {center_x}, y: {center_y}",
        (center_x - 10, center_y - 10),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.5,
        GREEN,
        2,
    )
    return picture
