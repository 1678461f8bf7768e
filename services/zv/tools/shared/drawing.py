"""Draws the objects of a result on the picture of its frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.messages import Centroid, Tracks

GREEN = (0, 255, 0)
COLOURS = (GREEN, (0, 191, 255), (255, 128, 0), (255, 0, 255), (0, 255, 255), (128, 128, 255))
"""BGR colours, assigned in turn by the track's id."""

FAR = 1 << 20
TEXT_HEIGHT_SHARE = 0.03
FONT_PIXELS = 22.0
"""Height of OpenCV's plain font at scale 1."""


def draw(bgr: NDArray[np.uint8], result: Centroid | Tracks) -> NDArray[np.uint8]:
    """Return a picture with a box, a centre and a label for each detected object.

    Args:
        bgr: (height, width, 3) uint8; not modified. May be smaller than the frame.
        result: Of the same frame, in pixels of the full frame.
    """
    picture = bgr.copy()
    height, width = bgr.shape[:2]
    scale = width / result.header.width, height / result.header.height
    if isinstance(result, Tracks):
        for track in result.tracks:
            colour = COLOURS[track.id % len(COLOURS)]
            label = f"{track.id}" if track.state == "confirmed" else f"{track.id} {track.state}"
            _mark(picture, track.box, (track.x, track.y), label, colour, scale)
    elif result.box is not None and result.x is not None and result.y is not None:
        label = f"x: {result.x}, y: {result.y}"
        _mark(picture, result.box, (result.x, result.y), label, GREEN, scale)
    return picture


def _mark(
    picture: NDArray[np.uint8],
    box: tuple[int, int, int, int],
    centre: tuple[float, float],
    label: str,
    colour: tuple[int, int, int],
    scale: tuple[float, float],
) -> None:
    x, y, width, height = box
    points = np.array([(x, y), (x + width, y + height), centre]) * scale
    # OpenCV cannot represent coordinates too far outside.
    corner, opposite, middle = points.round().clip(-FAR, FAR).astype(int).tolist()
    size = max(10.0, picture.shape[0] * TEXT_HEIGHT_SHARE)
    thick = max(1, round(size / 8))
    cv2.rectangle(picture, corner, opposite, colour, thick)
    cv2.circle(picture, middle, 2 * thick, colour, -1)
    baseline = (corner[0], max(round(size), corner[1] - thick - 2))
    font, font_scale = cv2.FONT_HERSHEY_SIMPLEX, size / FONT_PIXELS
    cv2.putText(picture, label, baseline, font, font_scale, colour, thick, cv2.LINE_AA)
