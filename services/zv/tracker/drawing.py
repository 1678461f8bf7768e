"""Draws tracks with their ids and trails into a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.box_association import ScoredBox
from zv.tracker.tracking.track import Track

LOST_COLOR = (160, 160, 160)
HUE_STEP = 111.25
"""Step between the hues of successive ids, modulo 180 as in OpenCV; by the golden ratio, the
colours of any few successive ids differ clearly."""

FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw_tracks(
    bgr: NDArray[np.uint8],
    tracks: Sequence[Track],
    trails: Mapping[int, Sequence[tuple[float, float]]],
    shift: tuple[int, int] = (0, 0),
) -> NDArray[np.uint8]:
    """Return a copy of a frame with its confirmed and lost tracks drawn; the frame if it has none.

    Args:
        bgr: (height, width, 3) uint8; not modified.
        tracks: In full-resolution pixels; tentative ones are not drawn.
        trails: Earlier centres by id, oldest first.
        shift: From where the trails are to where the frame shows them.
    """
    shown = [track for track in tracks if track.state != "tentative"]
    if not shown:
        return bgr
    picture = bgr.copy()
    for track in shown:
        color = color_of(track.id) if track.state == "confirmed" else LOST_COLOR
        trail = np.rint(np.reshape(trails.get(track.id, ()), (-1, 1, 2)) + shift).astype(np.int32)
        cv2.polylines(picture, [trail], False, color, 2, cv2.LINE_AA)
        x, y, width, height = track.box
        thickness = 2 if track.state == "confirmed" else 1
        cv2.rectangle(picture, (x, y), (x + width - 1, y + height - 1), color, thickness)
        cv2.circle(picture, (round(track.x), round(track.y)), 3, color, -1)
        place = (x, y - 5 if y > 20 else y + height + 15)
        words = str(track.id)
        if track.class_name is not None:
            words += f" {printable_ascii(track.class_name)} {100 * (track.score or 0):.0f}%"
        for ink, width in (((0, 0, 0), 5), (color, 2)):  # legible on any background
            cv2.putText(picture, words, place, FONT, 0.6, ink, width)
    return picture


def draw_boxes(bgr: NDArray[np.uint8], boxes: Sequence[ScoredBox]) -> NDArray[np.uint8]:
    """Return a copy of a picture with boxes, their classes and scores; each class has a colour.

    Args:
        bgr: (height, width, 3) uint8; not modified.
        boxes: In pixels of the picture, the surest first; they are drawn last.
    """
    picture = bgr.copy()
    names = sorted({each.name for each in boxes})
    scale = max(1.0, max(bgr.shape[:2]) / 1000)
    for each in reversed(boxes):
        color = color_of(1 + names.index(each.name))
        left, top, right, bottom = (round(edge) for edge in each.region[:4])
        thickness = round(2 * scale)
        cv2.rectangle(picture, (left, top), (right - 1, bottom - 1), color, thickness)
        words = f"{printable_ascii(each.name)} {each.score:.2f}"
        (width, height), below = cv2.getTextSize(words, FONT, 0.6 * scale, thickness)
        height += below
        foot = top if top >= height else top + height  # inside at the border of the picture
        corners = (left, foot - height), (left + width, foot)
        cv2.rectangle(picture, *corners, color, cv2.FILLED)
        at = left, foot - below // 2
        cv2.putText(picture, words, at, FONT, 0.6 * scale, (0, 0, 0), thickness // 2)
    return picture


def printable_ascii(text: str) -> str:
    """Return a text with ``?`` for what OpenCV's font does not have."""
    return text.encode("ascii", "replace").decode()


def color_of(number: int) -> tuple[int, int, int]:
    """Return the colour of a track by its id, BGR."""
    pixel = np.array([[[number * HUE_STEP % 180, 220, 255]]], np.uint8)
    blue, green, red = cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0].tolist()
    return blue, green, red
