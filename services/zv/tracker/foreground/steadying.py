"""Measures by how much a camera that shakes has moved a picture, and moves it back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

SMALLER: Final = 6
"""Pictures are compared at this fraction of their size, so that some pixels of shake are one."""


@dataclass(frozen=True, slots=True)
class SteadyLimits:
    """The constants of steadying."""

    rounds: int = 4  # largest number of steps of the fit
    enough: float = 0.05  # it ends when it changes by less, pixels of the small picture
    base: float = 2.0  # a pixel weighs half at this difference, grey levels,
    spread: float = 1.5  # or at this multiple of the median difference
    most: float = 12.0  # a larger difference says no more than this one, grey levels
    # The picture is moved back if that leaves less than this share of the differences: the texture
    # of a belt moves as well, but little agrees then.
    better: float = 0.92
    farthest: float = 0.05  # it is not if that is farther, shares of its smaller side


class Steadier:
    """Measures by how many pixels pictures are moved from the background.

    Source: B. D. Lucas and T. Kanade, "An iterative image registration technique with an
    application to stereo vision", 1981, with one motion for the whole picture, and Cauchy's weights
    to leave out objects.
    """

    def __init__(self, limits: SteadyLimits) -> None:
        self._limits = limits
        self._known: Image | None = None

    def moved(self, background: Image, small: Image) -> tuple[int, int]:
        """Return by how many whole pixels, x and y, a picture is moved from the background.

        Args:
            background: (height, width, 3) uint8 BGR, in the light of the picture.
            small: The picture, ``reduced``.
        """
        seen = small.astype(np.float32)
        limits = self._limits
        if background is not self._known:
            self._known, self._still = background, reduced(background).astype(np.float32)
            self._slopes = [
                cv2.Sobel(self._still, cv2.CV_32F, dx, 1 - dx, scale=1 / 8) for dx in (1, 0)
            ]
        x = y = 0.0
        off = first = self._off(seen, x, y)
        for _ in range(limits.rounds):
            right, down = self._step(off)
            x, y = x + right, y + down
            off = self._off(seen, x, y)
            if max(abs(right), abs(down)) < limits.enough:
                break
            if round(SMALLER * x) == round(SMALLER * y) == 0:
                return 0, 0  # as it is with a camera that stands, at the first step
        found = round(SMALLER * x), round(SMALLER * y)
        if max(map(abs, found)) > limits.farthest * min(background.shape[:2]):
            return 0, 0
        left, usual = (float(np.minimum(np.abs(each), limits.most).mean()) for each in (off, first))
        return found if left < limits.better * usual else (0, 0)

    def _off(self, seen: Floats, x: float, y: float) -> Floats:
        """Return how a small picture, moved back, differs from the background, but in light."""
        off = (_moved_back(seen, x, y) if x or y else seen) - self._still
        return np.asarray(off - np.median(off[::2, ::2]), np.float32)

    def _step(self, off: Floats) -> tuple[float, float]:
        """Return the motion that explains most of some differences."""
        limits, (along, across) = self._limits, self._slopes
        scale = max(limits.base, limits.spread * float(np.median(np.abs(off[::2, ::2]))))
        weights = 1 / (1 + np.square(off * np.float32(1 / scale)))
        weighted = weights * along, weights * across
        xx, xy = float(np.vdot(weighted[0], along)), float(np.vdot(weighted[0], across))
        yy = float(np.vdot(weighted[1], across))
        x, y = (float(np.vdot(each, off)) for each in weighted)
        whole = xx * yy - xy * xy + 1e-3  # not 0 before a plain wall
        return (xy * y - yy * x) / whole, (xy * x - xx * y) / whole


def reduced(picture: Image) -> Image:
    """Return a picture, (height, width, 3) uint8 BGR, in grey at a fraction of its size."""
    height, width = picture.shape[:2]
    size = max(1, width // SMALLER), max(1, height // SMALLER)
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)


def moved_back(picture: Image, moved: tuple[int, int]) -> Image:
    """Return a picture moved back by whole pixels, x and y; its border is continued."""
    return np.asarray(_moved_back(picture, *moved), np.uint8) if any(moved) else picture


def clear_unseen(mask: Image, moved: tuple[int, int]) -> None:
    """Set to 0 what a mask has where a picture, moved back, was continued."""
    x, y = moved
    if x > 0:
        mask[:, -x:] = 0
    if x < 0:
        mask[:, :-x] = 0
    if y > 0:
        mask[-y:] = 0
    if y < 0:
        mask[:-y] = 0


def _moved_back(picture: NDArray[Any], x: float, y: float) -> NDArray[Any]:
    shift = np.array([[1, 0, x], [0, 1, y]], np.float32)
    size = picture.shape[1], picture.shape[0]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(picture, shift, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
