"""Finds the largest moving object of each frame by background subtraction, and draws it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

GREEN = (0, 255, 0)


@dataclass(frozen=True, slots=True)
class MovingObject:
    """A moving object in one frame."""

    box: tuple[int, int, int, int]  # x, y, width, height of the bounding box, pixels
    area: float  # area of the contour, square pixels

    @property
    def center(self) -> tuple[int, int]:
        """The centre of the box, rounded as in the tutorial, which calls it the centroid."""
        x, y, width, height = self.box
        return x + int(width / 2), y + int(height / 2)


@dataclass(frozen=True, slots=True)
class LargestObjectParameters:
    """The parameters of ``LargestObject``."""

    history: int  # frames that form the background model
    var_threshold: float  # squared Mahalanobis distance above which a pixel is foreground
    detect_shadows: bool  # mark shadows with 127, which the threshold then drops
    closing: int  # side of the kernel, pixels; 0 for none
    median: int  # side of the filter, odd, pixels; 0 for none
    threshold: int  # mask values above it are foreground


class LargestObject:
    """The tutorial's pipeline: MOG2, closing, median, threshold, largest contour.

    Source: seed tutorial, "Real-Time Object Tracking Using OpenCV and a Webcam"; MOG2 is
    Z. Zivkovic, "Improved adaptive Gaussian mixture model for background subtraction", 2004.
    """

    def __init__(self, parameters: LargestObjectParameters) -> None:
        self._background = cv2.createBackgroundSubtractorMOG2()
        self.adjust(parameters)

    def adjust(self, parameters: LargestObjectParameters) -> None:
        """Continue with other parameters; keep the learned background."""
        self._parameters = parameters
        self._background.setHistory(parameters.history)
        self._background.setVarThreshold(parameters.var_threshold)
        self._background.setDetectShadows(parameters.detect_shadows)

    def update(self, bgr: NDArray[np.uint8]) -> tuple[MovingObject | None, NDArray[np.uint8]]:
        """Update the background model with a frame, and find the largest moving object in it.

        Args:
            bgr: (height, width, 3) uint8, of the same size each time; not modified.

        Returns:
            The object with the largest contour area, the first of equal ones, or None without
            contours; and the foreground mask, (height, width) uint8 of 0 and 255, a new array.
        """
        closing, median = self._parameters.closing, self._parameters.median
        mask = self._background.apply(bgr)
        if closing:
            kernel = np.ones((closing, closing), np.uint8)
            mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
        if median:
            mask = cv2.medianBlur(mask, median)
        _, mask = cv2.threshold(mask, self._parameters.threshold, 255, cv2.THRESH_BINARY)
        contours, _ = cv2.findContours(mask, cv2.RETR_TREE, cv2.CHAIN_APPROX_SIMPLE)
        foreground = np.asarray(mask, np.uint8)
        if not contours:
            return None, foreground
        areas = [cv2.contourArea(contour) for contour in contours]
        largest = int(np.argmax(areas))
        x, y, width, height = cv2.boundingRect(contours[largest])
        return MovingObject((x, y, width, height), areas[largest]), foreground


def draw(bgr: NDArray[np.uint8], found: MovingObject | None) -> NDArray[np.uint8]:
    """Return a copy of the frame with the object drawn; the frame itself without an object.

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
