"""The appearance of an object: its silhouette, and colour histograms from its top to its bottom."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.region import Region

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

LEVELS = 8
"""Bins of a histogram for each colour channel."""

BANDS = 6
"""Horizontal bands of an object, from its top to its bottom; each has its own histogram."""

SILHOUETTE = (12, 12)
"""Rows and columns into which a silhouette is divided."""


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


class Appearance:
    """The silhouette and the colour histograms of an object, learned over time.

    Attributes:
        silhouette: How often each cell of the object's box was foreground, 0 to 1, of shape
            ``SILHOUETTE``; None before anything was learned.
        colors: The histogram of each band, (BANDS, LEVELS ** 3), each with the sum 1; None before
            any was learned.
    """

    def __init__(self) -> None:
        self.silhouette: Floats | None = None
        self.colors: Floats | None = None

    def learn(self, scene: Scene, box: Region, share: float) -> None:
        """Adapt the appearance to a frame.

        Args:
            scene: The frame.
            box: The object's box, which shows no other object.
            share: Weight of this frame, 0 to 1; the first frame has the weight 1.
        """
        cut = scene.cut(box)
        mask = scene.mask[cut]
        if min(mask.shape) < 2:
            return
        seen = cv2.resize(mask, SILHOUETTE[::-1], interpolation=cv2.INTER_AREA)
        silhouette = np.asarray(seen, np.float32) * np.float32(1 / 255)
        histograms = histograms_of(scene.picture[cut], mask)
        if self.silhouette is None or self.colors is None:
            self.silhouette, self.colors = silhouette, histograms
            return
        self.silhouette += (silhouette - self.silhouette) * np.float32(share)
        self.colors += (histograms - self.colors) * np.float32(share)


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
