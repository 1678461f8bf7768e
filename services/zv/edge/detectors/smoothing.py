"""Gaussian smoothing, and the base class of detections that begin with it."""

from __future__ import annotations

from functools import cached_property
from typing import Generic, Protocol, TypeVar

import cv2
import numpy as np

from zv.edge.detectors.detection import Detection, Gray


def smooth(gray: Gray, sigma: float) -> Gray:
    """Smooth a grey picture by a Gaussian of ``sigma`` pixels; 0 returns the picture itself.

    At the border the picture is mirrored without repeating the outermost pixels.
    """
    return gray if sigma == 0 else np.asarray(cv2.GaussianBlur(gray, (0, 0), sigma), np.uint8)


class Smoothing(Protocol):
    """A detector with the parameter ``sigma``, pixels."""

    @property
    def sigma(self) -> float:
        """Standard deviation of the Gaussian; 0 for none."""


Kind = TypeVar("Kind", bound=Smoothing)


class SmoothedDetection(Detection, Generic[Kind]):
    """A detection of a grey picture, (height, width) uint8, whose first step is a Gaussian."""

    def __init__(self, detector: Kind, picture: Gray) -> None:
        self._detector = detector
        self._picture = picture

    @cached_property
    def smoothed(self) -> Gray:
        """The smoothed picture, (height, width) uint8."""
        return smooth(self._picture, self._detector.sigma)
