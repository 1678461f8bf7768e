"""Fits a tone curve from the background to a picture: exposure, white balance, lamps, clouds."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

LEVELS = np.arange(256, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class LightLimits:
    """The constants of the fit."""

    samples: int = 2000  # number of pixels that are compared
    # A fit is made when the median difference of the darker or of the brighter half of the pixels
    # exceeds this, grey levels.
    drift: float = 0.75
    base: float = 3.0  # a pixel agrees with the background up to this difference, grey levels,
    share: float = 0.06  # plus this share of its brightness
    gain: float = 20.0  # cost of changing the gain of a scene without contrast, square grey levels
    gains: tuple[float, float] = (0.15, 6.0)  # smallest and largest slope of the curve
    # A new curve is taken if this larger share of the pixels agrees: where traffic hides most of
    # the scene, it fits the traffic, and the former one is better.
    better: float = 0.02
    bin_levels: int = 16  # width of the parts in which the curve may bend, grey levels
    bin_weight: float = 20.0  # number of pixels that outweighs the assumption of no bend


class Light:
    """The light of the newest picture relative to that in which the background is kept.

    The background stays in one light for ever, so that an error of the fit cannot be learned and
    grow. A curve is accepted only if more of the scene agrees with the picture than before.

    Attributes:
        curve: (256, 3) float32: for each value of the background, that of the picture; ascending.
        gains: (3,), mean slope of each channel.
    """

    def __init__(self, limits: LightLimits) -> None:
        self.limits = limits
        self.curve: Floats = np.repeat(LEVELS[:, None], 3, axis=1)
        self.gains: Floats = np.ones(3, np.float32)

    def follow(self, background: Image, picture: Image, hidden: Image | None) -> bool:
        """Fit the curve to a picture if the light seems to have changed.

        Args:
            background: (height, width, 3) uint8.
            picture: The same.
            hidden: (height, width) uint8, not 0 where objects hide the background.

        Returns:
            Whether the curve changed.
        """
        height, width = picture.shape[:2]
        step = max(1, round((height * width / self.limits.samples) ** 0.5))
        rows, columns = (slice(min(step, side) // 2, None, step) for side in (height, width))
        grid = rows, columns
        before, seen = background[grid].reshape(-1, 3), picture[grid].reshape(-1, 3)
        if hidden is not None:
            free = hidden[grid].ravel() == 0
            if np.count_nonzero(free) >= 0.1 * free.size:
                before, seen = before[free], seen[free]
        after = seen.astype(np.float32)
        off = after - self._shown(self.curve, before)
        if not self._drifted(before, off):
            return False
        curve, gains = self._fitted(before, after)
        new_off = after - self._shown(curve, before)
        gain = self._agreement(new_off, after) - self._agreement(off, after)
        if gain <= self.limits.better and (gain < 0 or np.abs(new_off).sum() >= np.abs(off).sum()):
            return False
        self.curve, self.gains = curve, gains
        return True

    @staticmethod
    def _shown(curve: Floats, values: Image) -> Floats:
        return np.asarray(cv2.LUT(values[None], curve[None])[0], np.float32)

    def _agreement(self, off: Floats, after: Floats) -> float:
        near = np.abs(off) < self.limits.base + self.limits.share * after
        return float(np.mean(near[:, 0] & near[:, 1] & near[:, 2]))

    def _drifted(self, before: Image, off: Floats) -> bool:
        drift = self.limits.drift
        for channel in range(3):
            values, differences = before[:, channel], off[:, channel]
            bright = values > np.partition(values, values.size // 2)[values.size // 2]
            for half in (differences[bright], differences[~bright]):
                for side in (half > drift, half < -drift):  # more than a half: so is the median
                    if 2 * np.count_nonzero(side) > half.size:
                        return True
        return False

    def _fitted(self, before: Image, after: Floats) -> tuple[Floats, Floats]:
        """Return the curve and the gains that fit most pixels of each channel."""
        curve = np.empty_like(self.curve)
        gains = np.empty_like(self.gains)
        for channel in range(3):
            x, y = before[:, channel].astype(np.float32), after[:, channel]
            gain, offset = self._line(x, y, float(self.gains[channel]))
            curve[:, channel] = self._bent(x, y, gain, offset)
            gains[channel] = gain
        return curve, gains

    def _line(self, x: Floats, y: Floats, usual: float) -> tuple[float, float]:
        """Fit a straight line by iteratively reweighted least squares (Cauchy's weights)."""
        limits = self.limits
        scale = limits.base + limits.share * y
        weights = np.ones_like(x)
        gain, offset = usual, 0.0
        for width in (8.0, 4.0, 2.0, 1.0):
            total = float(weights.sum())
            mean_x, mean_y = float(weights @ x) / total, float(weights @ y) / total
            dx = x - mean_x
            variance = float(weights @ (dx * dx)) / total
            common = float(weights @ (dx * (y - mean_y))) / total
            gain = (common + limits.gain * usual) / (variance + limits.gain)
            gain = min(max(gain, limits.gains[0]), limits.gains[1])
            offset = mean_y - gain * mean_x
            off = (y - gain * x - offset) / (width * scale)
            weights = np.asarray(1.0 / (1.0 + off * off), np.float32)
        return gain, offset

    def _bent(self, x: Floats, y: Floats, gain: float, offset: float) -> Floats:
        """Return a line bent to the mean differences of the pixels near it, as gamma bends it."""
        limits = self.limits
        off = y - gain * x - offset
        near = np.abs(off) < 3 * (limits.base + limits.share * y)
        bins = (x[near] / limits.bin_levels).astype(np.intp)
        count = -(-256 // limits.bin_levels)
        sums = np.bincount(bins, off[near], count)
        bends = sums / (np.bincount(bins, minlength=count) + limits.bin_weight)
        centres = (np.arange(count) + 0.5) * limits.bin_levels
        line = gain * LEVELS + offset + np.interp(LEVELS, centres, bends).astype(np.float32)
        return np.asarray(np.maximum.accumulate(np.clip(line, 0, 255)), np.float32)
