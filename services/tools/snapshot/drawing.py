"""Centroids and tracks drawn on a picture: arrays in, arrays out."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from common.messages import Centroid, Tracks

GREEN = (0, 255, 0)
COLOURS = (
    (0, 255, 0),
    (0, 191, 255),
    (255, 128, 0),
    (255, 0, 255),
    (0, 255, 255),
    (128, 128, 255),
)
"""BGR, one after the other by the track's id."""

FAR = 1 << 20
TEXT_HEIGHT_SHARE = 0.03
FONT_PIXELS = 22.0
"""Height of OpenCV's plain font at scale 1."""


def draw_centroid(bgr: NDArray[np.uint8], centroid: Centroid) -> NDArray[np.uint8]:
    """Return the picture with the largest object's box, centre and coordinates.

    Args:
        bgr: (height, width, 3) uint8; not modified. May be smaller than the frame.
        centroid: Of the same frame, in pixels of the full frame.
    """
    picture = bgr.copy()
    if centroid.box is not None and centroid.x is not None and centroid.y is not None:
        label = f"x: {centroid.x}, y: {centroid.y}"
        _mark(picture, centroid.box, (centroid.x, centroid.y), label, GREEN, _scale(bgr, centroid))
    return picture


def draw_tracks(bgr: NDArray[np.uint8], tracks: Tracks) -> NDArray[np.uint8]:
    """Return the picture with each object's box, centre and id.

    Args:
        bgr: (height, width, 3) uint8; not modified. May be smaller than the frame.
        tracks: Of the same frame, in pixels of the full frame.
    """
    picture = bgr.copy()
    scale = _scale(bgr, tracks)
    for track in tracks.tracks:
        colour = COLOURS[track.id % len(COLOURS)]
        label = f"{track.id}" if track.state == "confirmed" else f"{track.id} {track.state}"
        _mark(picture, track.box, (track.x, track.y), label, colour, scale)
    return picture


def _scale(bgr: NDArray[np.uint8], message: Centroid | Tracks) -> tuple[float, float]:
    """Return pixels of the picture per pixel of the frame, across and down."""
    height, width = bgr.shape[:2]
    return width / message.header.width, height / message.header.height


def _point(x: float, y: float, scale: tuple[float, float]) -> tuple[int, int]:
    """Return a point of the frame in the picture, no further out than OpenCV can count."""
    across, down = (round(value * by) for value, by in zip((x, y), scale, strict=True))
    return max(-FAR, min(FAR, across)), max(-FAR, min(FAR, down))


def _mark(
    picture: NDArray[np.uint8],
    box: tuple[int, int, int, int],
    centre: tuple[float, float],
    label: str,
    colour: tuple[int, int, int],
    scale: tuple[float, float],
) -> None:
    x, y, width, height = box
    corner = _point(x, y, scale)
    opposite = _point(x + width, y + height, scale)
    middle = _point(*centre, scale)
    size = max(10.0, picture.shape[0] * TEXT_HEIGHT_SHARE)
    thick = max(1, round(size / 8))
    cv2.rectangle(picture, corner, opposite, colour, thick)
    cv2.circle(picture, middle, 2 * thick, colour, -1)
    baseline = (corner[0], max(round(size), corner[1] - thick - 2))
    cv2.putText(
        picture,
        label,
        baseline,
        cv2.FONT_HERSHEY_SIMPLEX,
        size / FONT_PIXELS,
        colour,
        thick,
        cv2.LINE_AA,
    )
