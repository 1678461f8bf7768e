"""Fits a picture into a model's input, and maps boxes from there back to the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.detector.options import Fit

Pixels = NDArray[np.uint8]

GREY: Final = 114
"""The margins' value, as YOLO models are trained with."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a picture is in a model's input, both of one size; lengths in pixels."""

    picture: tuple[int, int]  # width and height of the picture
    canvas: tuple[int, int]  # width and height of the input
    size: tuple[int, int]  # width and height of the picture in the input
    left: int  # column of the input where the picture begins
    top: int  # row of the input where the picture begins

    def drawn(self, pixels: Pixels) -> Pixels:
        """Return the input's picture, (height, width, 3) uint8.

        Args:
            pixels: The picture, perhaps reduced: (height, width, 3) uint8.
        """
        if self.size == self.canvas:
            return _resized(pixels, self.size)
        (width, height), (across, down) = self.canvas, self.size
        canvas = np.empty((height, width, 3), np.uint8)
        bottom, right = self.top + down, self.left + across
        canvas[: self.top], canvas[bottom:] = GREY, GREY
        canvas[self.top : bottom, : self.left] = GREY
        canvas[self.top : bottom, right:] = GREY
        if across == width:  # its rows are in one piece of memory
            cv2.resize(pixels, self.size, dst=canvas[self.top : bottom])
        else:
            canvas[self.top : bottom, self.left : right] = _resized(pixels, self.size)
        return canvas

    def in_picture(self, boxes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Map boxes from the input to the picture, and cut them at its borders.

        Args:
            boxes: (n, 4): left, top, right, bottom in pixels of the input.
        """
        (width, height), (across, down) = self.picture, self.size
        found = boxes.astype(np.float32)
        found[:, 0::2] = np.clip((found[:, 0::2] - self.left) * (width / across), 0, width)
        found[:, 1::2] = np.clip((found[:, 1::2] - self.top) * (height / down), 0, height)
        return found


def placement(picture: tuple[int, int], canvas: tuple[int, int], fit: Fit) -> Placement:
    """Return where a picture is in an input."""
    if fit == "stretch":
        return Placement(picture, canvas, canvas, 0, 0)
    (width, height), (across, down) = picture, canvas
    factor = min(across / width, down / height)
    size = max(1, round(width * factor)), max(1, round(height * factor))
    if fit == "corner":
        return Placement(picture, canvas, size, 0, 0)
    # An odd margin has its extra pixel at the right and below.
    return Placement(picture, canvas, size, (across - size[0]) // 2, (down - size[1]) // 2)


def _resized(pixels: Pixels, size: tuple[int, int]) -> Pixels:
    if pixels.shape[1::-1] == size:
        return pixels
    return np.asarray(cv2.resize(pixels, size), np.uint8)
