"""Learns the background of a fixed camera, and subtracts it from pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Subtractor = Literal["mog2", "knn"]

Image = NDArray[np.uint8]

HISTORY = 500
BACKGROUND_RATIO = 0.5
"""With this ratio, the background is the most frequent value of a pixel, not a mean of two."""

SHADOW_RATIO = 0.5
"""A shadow has the background's colour, and at least this share of its brightness."""

SHADOW = 127
"""Value of shadows in a mask."""

LEAST_VARIANCE, FIRST_VARIANCE, MAX_VARIANCE = 4.0, 15.0, 75.0
"""Bounds and first value of a pixel's noise variance, the sum over colours, square grey levels."""

MEDIAN_DEVIATION = 0.6745
"""Half of the values of a normal distribution are within this many standard deviations."""

LEARN_EVERY_S = 1.0
SETTLING_S = 1.0
FORCED_RATE = 0.5
FORCED_STEPS = 4
"""After this many steps, a new value has 94 % of the weight and is the background."""


class BackgroundModel:
    """A background model that learns by time, not by frames.

    The background is learned once a second, so that the result does not depend on the frame rate.
    Each frame is compared with the background picture. A pixel is foreground if its distance in
    colour exceeds the pixel's own limit, which follows the noise measured there, unless it looks
    like a shadow on the background.

    Sources: Z. Zivkovic, F. van der Heijden, "Efficient adaptive density estimation per image pixel
    for the task of background subtraction", 2006, as OpenCV implements it (MOG2 and KNN), for the
    background; A. Manzanera, J. Richefeu, "A new motion detection algorithm based on
    sigma-delta background estimation", 2007, for the limits; T. Horprasert et al., "A statistical
    approach for real-time robust background subtraction and shadow detection", 1999.

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
        self._model.setDetectShadows(False)
        self._limits: Image = np.zeros((0, 0, 3), np.uint8)
        self._deviations = 0.0
        self.adjust(25.0, detect_shadows=True)
        self._picture: Image = np.zeros((0, 0, 3), np.uint8)
        self._stale = False
        self._started_ns: int | None = None
        self._learned_ns = 0

    @property
    def empty(self) -> bool:
        """Whether no picture was learned yet."""
        return self._started_ns is None

    @property
    def limits(self) -> Image:
        """The difference up to which each value is background.

        (height, width, 3) uint8, grey levels; not to be modified.
        """
        return self._limits

    def adjust(self, var_threshold: float, *, detect_shadows: bool) -> None:
        """Set the squared distance, in standard deviations, above which a pixel is foreground."""
        deviations = math.sqrt(var_threshold)
        if self._limits.size:
            scale = deviations / self._deviations
            limits = np.asarray(cv2.convertScaleAbs(self._limits, alpha=scale), np.uint8)
            self._deviations = deviations
            np.clip(limits, *self._limits_allowed(), out=self._limits)
        self._deviations = deviations
        self._detect_shadows = detect_shadows

    def start(self, picture: Image, stamp_ns: int) -> None:
        """Forget everything and take a picture, (height, width, 3) uint8 BGR, as background."""
        self.replace(picture)
        self._limits = np.full_like(picture, self._limit(FIRST_VARIANCE))
        self._started_ns = self._learned_ns = stamp_ns

    def replace(self, picture: Image) -> None:
        """Take another picture as background, without starting the fast learning again."""
        self._model.apply(picture, learningRate=1.0)
        self._picture, self._stale = picture.copy(), False

    def foreground(self, picture: Image) -> Image:
        """Subtract the background from a picture, (height, width, 3) uint8 BGR.

        Returns:
            (height, width) uint8: 255 foreground, 127 shadow, 0 background.
        """
        background, limits = self.picture(), self._limits
        off = cv2.absdiff(picture, background)
        beyond = cv2.compare(off, limits, cv2.CMP_GT, off)
        # The grey value is not 0 if any channel is 255. Single pixels that differ are noise.
        differs = np.asarray(cv2.medianBlur(cv2.cvtColor(beyond, cv2.COLOR_BGR2GRAY), 3), np.uint8)
        places = np.flatnonzero(differs > 0)  # few, so that costly tests take little time
        shown, expected, allowed = (
            _colours_at(each, places).astype(np.float32) for each in (picture, background, limits)
        )
        allowed_square, shown_square = _dot(allowed, allowed), _dot(shown, shown)
        common, expected_square = _dot(shown, expected), _dot(expected, expected)
        found = shown_square - 2 * common + expected_square > allowed_square
        marks = found.view(np.uint8) * np.uint8(255)
        if self._detect_shadows:
            ratio = common / np.maximum(expected_square, 1.0)
            # Squared distance of the colour from the background's, darkened by the ratio.
            tint_square = shown_square - ratio * common
            dark = (ratio >= SHADOW_RATIO) & (ratio <= 1.0)
            marks[found & dark & (tint_square < allowed_square * ratio * ratio)] = SHADOW
        differs.reshape(-1)[places] = marks
        return differs

    def alike_at(
        self, places: NDArray[np.intp], one: Image, others: Sequence[Image]
    ) -> NDArray[np.bool_]:
        """Return at which places a picture differs from some others only by noise.

        Args:
            places: (n,), indices of pixels in the flattened picture.
            one: (height, width, 3) uint8 BGR.
            others: The same.

        Returns:
            (n,).
        """
        values, largest = _colours_at(one, places), np.zeros((len(places), 3), np.uint8)
        for other in (_colours_at(each, places) for each in others):
            off = np.maximum(values, other) - np.minimum(values, other)
            np.maximum(largest, off, out=largest)
        near = largest <= _colours_at(self._limits, places)
        return near[:, 0] & near[:, 1] & near[:, 2]

    def learn(self, picture: Image, stamp_ns: int, known: Image | None, time_s: float) -> None:
        """Learn from a picture if an update is due.

        Args:
            picture: (height, width, 3) uint8 BGR.
            stamp_ns: When it was taken. Stamps that go backwards restart the intervals.
            known: (height, width) uint8, not 0 at known objects, which are not learned; None
                without.
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
        self._learn_noise(picture, known)
        self._apply(picture, known, rate)
        self._learned_ns = stamp_ns

    def _learn_noise(self, picture: Image, known: Image | None) -> None:
        """Move each limit by one grey level towards a multiple of the median deviation.

        Differences above twice the limit are ignored: they are objects or shadows, not noise.
        """
        limits = self._limits
        off = np.asarray(cv2.absdiff(picture, self.picture()), np.uint8)
        near = np.asarray(cv2.compare(off, cv2.add(limits, limits), cv2.CMP_LE), np.uint8)
        if known is not None:
            free = cv2.bitwise_not(known)
            near &= np.asarray(cv2.merge((free, free, free)), np.uint8)
        wanted = cv2.convertScaleAbs(off, alpha=self._deviations / MEDIAN_DEVIATION)
        more = np.asarray(cv2.compare(wanted, limits, cv2.CMP_GT), np.uint8)
        # 8-bit unsigned numbers throughout, since other types take ten times as long.
        moved = limits + (more & np.uint8(2)) - np.uint8(1)
        cv2.copyTo(np.clip(moved, *self._limits_allowed()), near, limits)

    def _limits_allowed(self) -> tuple[np.uint8, np.uint8]:
        """Return the smallest and the largest limit of one colour."""
        return np.uint8(self._limit(LEAST_VARIANCE)), np.uint8(self._limit(MAX_VARIANCE))

    def _limit(self, variance: float) -> int:
        """Return the limit of one colour for a variance of all three: 1 to 255 grey levels."""
        return min(255, max(1, round(self._deviations * math.sqrt(variance / 3))))

    def learn_at_once(self, picture: Image, where: Image) -> None:
        """Make a picture the background where the mask ``where``, (height, width), is not 0."""
        known = cv2.bitwise_not(where)
        for _ in range(FORCED_STEPS):
            self._apply(picture, np.asarray(known, np.uint8), FORCED_RATE)

    def _apply(self, picture: Image, known: Image | None, rate: float) -> None:
        if known is None:
            self._model.apply(picture, learningRate=rate)
        elif isinstance(self._model, cv2.BackgroundSubtractorMOG2):
            # By keyword: the second positional argument is the output array.
            self._model.apply(picture, knownForegroundMask=known, learningRate=rate)
        else:  # KNN also learns known foreground, so these pixels are replaced by the background
            cv2.copyTo(self.picture(), known, picture := picture.copy())
            self._model.apply(picture, learningRate=rate)
        self._stale = True

    def picture(self) -> Image:
        """Return the background, (height, width, 3) uint8 BGR; not to be modified."""
        if self._stale:
            found = np.asarray(self._model.getBackgroundImage(), np.uint8)
            if self.subtractor == "knn":  # its picture is black where samples do not agree yet
                black = cv2.inRange(found, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
                cv2.copyTo(self._picture, black, found)
            self._picture, self._stale = found, False
        return self._picture


def _colours_at(picture: Image, places: NDArray[np.intp]) -> Image:
    """Return the colours of pixels, (n, 3), by their indices in the flattened picture."""
    return picture.reshape(-1, 3).take(places, axis=0)


def _dot(one: NDArray[np.float32], other: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the dot products of the rows of two (n, 3) arrays, (n,)."""
    return np.asarray((one * other) @ np.ones(3, np.float32), np.float32)
