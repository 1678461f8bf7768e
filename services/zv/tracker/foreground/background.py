"""The learned background: its picture, its noise, and the range of values that agree with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.light import LEVELS, Light, LightLimits

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

WINDOW = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, slots=True)
class BackgroundLimits:
    """The constants of the background."""

    # A value agrees with the range of its neighbourhood up to this distance, grey levels,
    base: float = 3.0
    share: float = 0.06  # plus this share of the brightness: noise and compression grow with it,
    noise: float = 3.0  # plus this many mean deviations that were measured at this pixel
    most_noise: float = 20.0  # largest mean deviation of a pixel, grey levels
    strong: float = 2.0  # a pixel is strong at this multiple of the distance
    every_s: float = 0.25  # interval of learning, seconds
    noise_s: float = 10.0  # time constant of the noise, seconds
    # Range of a shadow's brightness, relative to the background's, both above that of black.
    shadow: tuple[float, float] = (0.6, 1.0)
    # Black is this percentile of the background: haze, a lens or a tone curve brightens it, and
    # what is much darker than the background would be taken for its shadow.
    black: float = 2.0
    # Times since the first picture at which the median of the pictures so far is taken.
    starts_s: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)
    keep_s: float = 0.1  # interval of these pictures, seconds


class Background:
    """The background of a fixed camera, kept in the light of the first picture.

    A value is background if it lies in the range of the 3x3 values around it, in the light of the
    picture, or beyond it by less than a distance that grows with brightness and noise. The range
    forgives aliasing and a pixel of shake.

    Attributes:
        light: The light of the newest picture.
        shown: (height, width, 3) uint8 BGR, in that light.
        unlit: The same in the light of the first one; another array whenever something was learned.
    """

    def __init__(self, picture: Image, limits: BackgroundLimits, light: LightLimits) -> None:
        self._limits = limits
        self.light = Light(light)
        self._scale = 1.0
        self._values: Floats = picture.astype(np.float32)
        self._noise: Floats = np.full_like(self._values, 1.0)
        self._kept = [picture.copy()]
        self._kept_s = self._learned_s = 0.0  # since the first picture
        self._starts = list(limits.starts_s)
        self._refresh()

    def start(self, picture: Image, age_s: float) -> None:
        """Begin again with the median of the first pictures, when one is due."""
        if not self._starts:
            return
        if age_s - self._kept_s >= self._limits.keep_s:
            self._kept.append(picture.copy())
            self._kept_s = age_s
        if age_s < self._starts[0]:
            return
        while self._starts and age_s >= self._starts[0]:
            del self._starts[0]
        if len(self._kept) >= 3:
            nine = [self._kept[round(at)] for at in np.linspace(0, len(self._kept) - 1, 9)]
            middle = _middle(nine)
            self._values = middle.astype(np.float32)
            off = [np.asarray(cv2.absdiff(each, middle), np.uint8) for each in nine]
            self._noise = _middle(off).astype(np.float32)
            self.light = Light(self.light.limits)
            self._refresh()
        if not self._starts:
            self._kept = []

    def adjust(self, scale: float) -> None:
        """Multiply the distance up to which values agree with the background."""
        if scale != self._scale:
            self._scale = scale
            self._illuminate()

    def follow_light(self, picture: Image, hidden: Image | None) -> None:
        """Fit the light to a picture; ``hidden`` is not 0 where objects hide the background."""
        if self.light.follow(self.unlit, picture, hidden):
            self._illuminate()

    def foreground(self, picture: Image, *, shadows: bool) -> tuple[Image, Image]:
        """Subtract the background from a picture, (height, width, 3) uint8 BGR.

        Args:
            picture: The newest one; ``follow_light`` has seen it.
            shadows: Whether shadows are left out.

        Returns:
            (height, width) uint8 of 0 and 255: the foreground, and its strong pixels.
        """
        near = cv2.inRange(picture, self._low, self._high)
        mask = np.asarray(cv2.medianBlur(cv2.bitwise_not(near), 3), np.uint8)
        places = np.flatnonzero(mask > 0)  # of a bool array, which is ten times faster
        strong = np.zeros_like(mask)
        if not places.size:
            return mask, strong
        shown, reach = _at(picture, places), _at(self._reach, places)
        low, high = (
            cv2.subtract(_at(self._low, places), shown),
            cv2.subtract(shown, _at(self._high, places)),
        )
        beyond = cv2.max(low, high).astype(np.float32)
        far = (beyond > reach * (self._limits.strong - 1.0)).any(axis=1)
        strong.reshape(-1)[places[far]] = 255
        if shadows:
            dark = self._is_shadow(shown, _at(self.shown, places), reach)
            mask.reshape(-1)[places[dark]] = 0
            mask = np.asarray(cv2.medianBlur(mask, 3), np.uint8)
            strong &= mask
        return mask, strong

    def _is_shadow(self, shown: Image, expected: Image, reach: Image) -> NDArray[np.bool_]:
        """Return which colours, (n, 3), are the expected ones with less light.

        Source: T. Horprasert et al., "A statistical approach for real-time robust background
        subtraction and shadow detection", 1999.
        """
        black = self.light.curve[self._black]
        one, other = (np.maximum(each - black, 0, dtype=np.float32) for each in (shown, expected))
        ones = np.ones(3, np.float32)
        square = np.maximum((other * other) @ ones, 1.0)
        ratio = ((one * other) @ ones) / square
        tint = (one * one) @ ones - ratio * ratio * square
        allowed = (reach.astype(np.float32) @ ones) / 3**0.5
        least, most = self._limits.shadow
        return np.asarray((ratio > least) & (ratio < most) & (tint < allowed * allowed), np.bool_)

    def change(self, picture: Image, before: Image, window: tuple[slice, slice]) -> float:
        """Return the share of the pixels of a window that differ by more than noise.

        Args:
            picture: (height, width, 3) uint8 BGR.
            before: The window of an earlier picture.
            window: Its rows and columns.
        """
        if not before.size:
            return 0.0
        off = cv2.absdiff(picture[window], before) > self._reach[window]
        differs = np.asarray(off.any(axis=2), np.uint8)
        return float(cv2.medianBlur(differs, 3).mean())

    def learn(self, picture: Image, age_s: float, kept: Image | None, time_s: float) -> None:
        """Learn from a picture if an update is due.

        Args:
            picture: (height, width, 3) uint8 BGR.
            age_s: Its time since the first one, seconds.
            kept: (height, width) uint8, not 0 where nothing is learned; None to learn everywhere.
            time_s: Time after which a change has become background by 63 %.
        """
        elapsed_s = age_s - self._learned_s
        if elapsed_s < self._limits.every_s:
            return
        self._learned_s = age_s
        free = None if kept is None else cv2.bitwise_not(kept)
        _, off = cv2.threshold(
            cv2.absdiff(picture, self.shown), self._limits.most_noise, 0, cv2.THRESH_TRUNC
        )
        cv2.accumulateWeighted(
            off, self._noise, 1 - math.exp(-elapsed_s / self._limits.noise_s), free
        )
        rate = 1 - math.exp(-elapsed_s / time_s)
        cv2.accumulateWeighted(self._unlit(picture), self._values, rate, free)
        self._refresh()

    def absorb(self, picture: Image, where: Image) -> None:
        """Make a picture the background where a mask, (height, width) uint8, is not 0."""
        cv2.copyTo(self._unlit(picture).astype(np.float32), where, self._values)
        for each in self._kept:
            cv2.copyTo(picture, where, each)
        self._refresh()

    def _unlit(self, picture: Image) -> Image:
        """Return a picture as it would be in the light in which the background is kept."""
        table = np.empty((1, 256, 3), np.float32)
        for channel in range(3):
            table[0, :, channel] = np.interp(LEVELS, self.light.curve[:, channel], LEVELS)
        return np.asarray(cv2.LUT(picture, np.rint(table).astype(np.uint8)), np.uint8)

    def _refresh(self) -> None:
        self.unlit = np.asarray(cv2.convertScaleAbs(self._values), np.uint8)
        percents = self._limits.black, 100.0 - self._limits.black
        dark, bright = np.percentile(self.unlit[::4, ::4], percents).tolist()
        # A plain scene, less than three times as bright where it is bright, may show nothing black.
        self._black = round(min(dark, max(0.0, bright - 2 * dark)))
        self._illuminate()

    def _illuminate(self) -> None:
        """Compute the values that agree with the background in the present light."""
        curve, limits = self.light.curve, self._limits
        self.shown = np.asarray(
            cv2.LUT(self.unlit, np.rint(curve).astype(np.uint8)[None]), np.uint8
        )
        reach = (limits.base + limits.share * curve) * self._scale
        table = np.rint(np.clip(reach, 1, 255)).astype(np.uint8)[None]
        noise = cv2.convertScaleAbs(self._noise, alpha=limits.noise * self._scale)
        self._reach = np.asarray(cv2.add(cv2.LUT(self.unlit, table), noise), np.uint8)
        # The curve ascends, so the least value of a neighbourhood is the same before and after it.
        self._low = np.asarray(cv2.subtract(cv2.erode(self.shown, WINDOW), self._reach), np.uint8)
        self._high = np.asarray(cv2.add(cv2.dilate(self.shown, WINDOW), self._reach), np.uint8)


def _at(picture: Image, places: NDArray[np.intp]) -> Image:
    """Return the colours of pixels, (n, 3), by their indices in the flattened picture."""
    return picture.reshape(-1, 3).take(places, axis=0)


def _middle(nine: Sequence[Image]) -> Image:
    """Return the approximate median of each value of nine pictures, from first to last.

    It is the ninther (J. W. Tukey, "The ninther", 1978): the median of the medians of three groups
    of three pictures, each taken from different times. It costs a twentieth of a sort.
    """
    return _median(*(_median(*nine[first::3]) for first in range(3)))


def _median(one: Image, two: Image, three: Image) -> Image:
    larger, smaller = cv2.max(one, two), cv2.min(one, two)
    return np.asarray(cv2.max(smaller, cv2.min(larger, three)), np.uint8)
