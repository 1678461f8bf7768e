"""The largest moving object of each frame, by background subtraction: arrays in, numbers out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class MovingObject:
    """What moves.

    Attributes:
        box: x, y, width, height of the bounding box, pixels.
        area: Of the contour, square pixels.
    """

    box: tuple[int, int, int, int]
    area: float

    @property
    def center(self) -> tuple[int, int]:
        """The box's centre as the tutorial computes it, which it calls the centroid."""
        x, y, width, height = self.box
        return x + int(width / 2), y + int(height / 2)


class Numbers(TypedDict):
    """The numbers of the chain, as ``LargestObject`` explains them."""

    history: int
    var_threshold: float
    detect_shadows: bool
    closing: int
    median: int
    threshold: int


class LargestObject:
    """The tutorial's chain: MOG2, closing, median, threshold, largest contour.

    Args:
        history: Frames that make the background model.
        var_threshold: Squared Mahalanobis distance that is foreground.
        detect_shadows: Mark shadows with 127, which the threshold then drops.
        closing: Side of the closing kernel, pixels; 0 for none.
        median: Side of the median filter, odd, pixels; 0 for none.
        threshold: Mask values above it are foreground.

    Source: seed tutorial, "Real-Time Object Tracking Using OpenCV and a Webcam"; MOG2 is
    Z. Zivkovic, "Improved adaptive Gaussian mixture model for background subtraction", 2004.
    """

    def __init__(
        self,
        *,
        history: int = 700,
        var_threshold: float = 25.0,
        detect_shadows: bool = True,
        closing: int = 20,
        median: int = 5,
        threshold: int = 127,
    ) -> None:
        self._background = cv2.createBackgroundSubtractorMOG2()
        self.adjust(
            history=history,
            var_threshold=var_threshold,
            detect_shadows=detect_shadows,
            closing=closing,
            median=median,
            threshold=threshold,
        )

    def adjust(
        self,
        *,
        history: int,
        var_threshold: float,
        detect_shadows: bool,
        closing: int,
        median: int,
        threshold: int,
    ) -> None:
        """Go on with other numbers; what was learned of the background stays."""
        self._background.setHistory(history)
        self._background.setVarThreshold(var_threshold)
        self._background.setDetectShadows(detect_shadows)
        self._kernel = np.ones((closing, closing), np.uint8) if closing else None
        self._median = median
        self._threshold = threshold

    def update(self, bgr: NDArray[np.uint8]) -> tuple[MovingObject | None, NDArray[np.uint8]]:
        """Take one frame into the background model and find what moves in it.

        Args:
            bgr: (height, width, 3) uint8, of the same size each time; not modified.

        Returns:
            The object with the largest contour area, the first of equals, or None; and the
            foreground mask, (height, width) uint8 of 0 and 255, a new array each time.
        """
        mask = self._background.apply(bgr)
        if self._kernel is not None:
            mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, self._kernel)
        if self._median:
            mask = cv2.medianBlur(mask, self._median)
        _, mask = cv2.threshold(mask, self._threshold, 255, cv2.THRESH_BINARY)
        contours, _ = cv2.findContours(mask, cv2.RETR_TREE, cv2.CHAIN_APPROX_SIMPLE)
        foreground = np.asarray(mask, np.uint8)
        if not contours:
            return None, foreground
        areas = [cv2.contourArea(contour) for contour in contours]
        largest = int(np.argmax(areas))
        x, y, width, height = cv2.boundingRect(contours[largest])
        return MovingObject((x, y, width, height), areas[largest]), foreground
