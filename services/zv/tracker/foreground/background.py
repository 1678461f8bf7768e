"""The learned background of a fixed camera, and the pixels of a picture that differ from it."""

from __future__ import annotations

import math
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Subtractor = Literal["mog2", "knn"]

Image = NDArray[np.uint8]

HISTORY = 500
BACKGROUND_RATIO = 0.9
SHADOW_RATIO = 0.5
"""A pixel that is darker than the background by at most this factor, in its colour, is a shadow."""

KNN_SCALE = 16.0
"""OpenCV's defaults for the squared distances of the two models, 400 and 25, have this ratio."""

LEARN_EVERY_S = 0.5
SETTLING_S = 1.0
FORCED_RATE = 0.5
FORCED_STEPS = 4
"""So many steps give a new value 94 % of the weight, and so make it the background."""


class BackgroundModel:
    """A model of the background that learns by time, not by frames.

    The foreground is measured with learning rate 0, and the model learns in separate steps. So the
    result does not depend on the frame rate, and most frames cost less.

    Source: Z. Zivkovic, F. van der Heijden, "Efficient adaptive density estimation per image pixel
    for the task of background subtraction", 2006, as OpenCV implements it (MOG2 and KNN).

    Args:
        subtractor: The model of a pixel: a mixture of Gaussians, or the nearest samples.
    """

    def __init__(self, subtractor: Subtractor = "mog2") -> None:
        self.subtractor = subtractor
        self._model: cv2.BackgroundSubtractorMOG2 | cv2.BackgroundSubtractorKNN
        if subtractor == "knn":
            self._model = cv2.createBackgroundSubtractorKNN()
        else:
            self._model = cv2.createBackgroundSubtractorMOG2()
            self._model.setBackgroundRatio(BACKGROUND_RATIO)
        self._model.setHistory(HISTORY)
        self._model.setShadowThreshold(SHADOW_RATIO)
        self._picture: Image | None = None
        self._started_ns: int | None = None
        self._learned_ns = 0

    @property
    def empty(self) -> bool:
        """Whether it has not seen a picture yet."""
        return self._started_ns is None

    def adjust(self, var_threshold: float, *, detect_shadows: bool) -> None:
        """Set the squared distance, in standard deviations, above which a pixel is foreground."""
        if isinstance(self._model, cv2.BackgroundSubtractorMOG2):
            self._model.setVarThreshold(var_threshold)
        else:
            self._model.setDist2Threshold(var_threshold * KNN_SCALE)
        self._model.setDetectShadows(detect_shadows)

    def start(self, picture: Image, stamp_ns: int) -> None:
        """Forget everything and take a picture, (height, width, 3) uint8 BGR, as background."""
        self._model.apply(picture, learningRate=1.0)
        self._picture = None
        self._started_ns = self._learned_ns = stamp_ns

    def replace(self, picture: Image) -> None:
        """Take another picture as background, without starting the fast learning again."""
        self._model.apply(picture, learningRate=1.0)
        self._picture = None

    def foreground(self, picture: Image) -> Image:
        """Return what differs: (height, width) uint8, 255 foreground, 127 shadow, 0 background."""
        return np.asarray(self._model.apply(picture, learningRate=0.0), np.uint8)

    def learn(self, picture: Image, stamp_ns: int, known: Image | None, time_s: float) -> None:
        """Learn from a picture if it is time for that.

        Args:
            picture: (height, width, 3) uint8 BGR.
            stamp_ns: When it was taken. Stamps that go backwards start the intervals anew.
            known: (height, width) uint8, not 0 where an object is known to be: not learned.
            time_s: Time after which a change has become background by 63 %.
        """
        if self._started_ns is None or stamp_ns < self._learned_ns:
            self._learned_ns = stamp_ns
            self._started_ns = min(stamp_ns, self._started_ns or stamp_ns)
            return
        elapsed_s = (stamp_ns - self._learned_ns) / 1e9
        age_s = (stamp_ns - self._started_ns) / 1e9
        if elapsed_s <= 0 or (elapsed_s < LEARN_EVERY_S and age_s > SETTLING_S):
            return
        rate = 1.0 - math.exp(-elapsed_s / time_s)
        if age_s <= SETTLING_S:
            rate = max(rate, elapsed_s / (2 * age_s))
        self._apply(picture, known, rate)
        self._learned_ns = stamp_ns

    def learn_at_once(self, picture: Image, where: Image) -> None:
        """Make what a picture shows the background, where ``where``, (height, width), is not 0."""
        known = cv2.bitwise_not(where)
        for _ in range(FORCED_STEPS):
            self._apply(picture, np.asarray(known, np.uint8), FORCED_RATE)

    def _apply(self, picture: Image, known: Image | None, rate: float) -> None:
        if known is None:
            self._model.apply(picture, learningRate=rate)
        elif isinstance(self._model, cv2.BackgroundSubtractorMOG2):
            # By its keyword: a second positional argument is where the result is written to.
            self._model.apply(picture, knownForegroundMask=known, learningRate=rate)
        else:  # KNN learns what it is told to be foreground, so it gets the background there
            cv2.copyTo(self.picture(), known, picture := picture.copy())
            self._model.apply(picture, learningRate=rate)
        self._picture = None

    def picture(self) -> Image:
        """Return the background, (height, width, 3) uint8 BGR; not to be modified."""
        if self._picture is None:
            self._picture = np.asarray(self._model.getBackgroundImage(), np.uint8)
        return self._picture
