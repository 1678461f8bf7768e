"""The appearance of an object: colour histograms from its top to its bottom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.region import Region

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

LEVELS = 8
"""Bins of a histogram for each colour channel."""

BANDS = 6
"""Horizontal bands of an object, from its top to its bottom; each has its own histogram."""


@dataclass(frozen=True, slots=True)
class Scene:
    """The pixels of one frame, for comparisons."""

    picture: Image  # (height, width, 3) uint8 BGR
    mask: Image  # (height, width) uint8, 255 on the foreground, else 0

    def cut(self, box: Region) -> tuple[slice, slice]:
        """Return the rows and columns of a box, clipped to the picture; they may be empty."""
        height, width = self.mask.shape
        left, top = max(0, round(box.left)), max(0, round(box.top))
        right, bottom = min(width, round(box.right)), min(height, round(box.bottom))
        return slice(top, max(top, bottom)), slice(left, max(left, right))


def learned(colors: Floats | None, scene: Scene, box: Region, share: float) -> Floats | None:
    """Return histograms as ``histograms_of`` does, adapted to a frame.

    Args:
        colors: The former ones; None before any were learned.
        scene: The frame.
        box: The object's box, which shows no other object.
        share: Weight of this frame, 0 to 1; the first frame has the weight 1.
    """
    cut = scene.cut(box)
    mask = scene.mask[cut]
    if min(mask.shape) < 2:
        return colors
    seen = histograms_of(scene.picture[cut], mask)
    return seen if colors is None else colors + (seen - colors) * np.float32(share)


def levels_of(picture: Image) -> NDArray[np.intp]:
    """Return the number of each pixel's histogram bin, below LEVELS ** 3, (height, width)."""
    levels = picture // np.uint8(256 // LEVELS)
    return np.asarray(levels @ np.array([LEVELS**2, LEVELS, 1]), np.intp)


def histograms_of(picture: Image, mask: Image) -> Floats:
    """Return the colour histogram of each band, (BANDS, LEVELS ** 3), each with the sum 1.

    Args:
        picture: (height, width, 3) uint8 BGR.
        mask: (height, width) uint8, not 0 on the object.
    """
    bands = np.arange(mask.shape[0]) * BANDS // max(1, mask.shape[0])
    numbers = levels_of(picture) + bands[:, None] * LEVELS**3
    counts = np.bincount(numbers[mask > 0], minlength=BANDS * LEVELS**3)
    found = counts.astype(np.float32).reshape(BANDS, -1)
    return np.asarray(found / np.maximum(found.sum(axis=1, keepdims=True), 1.0), np.float32)
