"""What an object looks like: a picture of it, and how often each of its pixels was seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.fragment import Fragment

Image = NDArray[np.uint8]

BINS = 8
COLOR_DEVIATION = 30.0
"""Typical difference between an object's colours in two frames, grey levels."""

UNSEEN_COST = 1.0
"""Cost of a pixel of the object that is background now, against 1 for one of another colour."""


@dataclass(frozen=True, slots=True)
class Scene:
    """The pixels of one frame, for comparisons.

    Attributes:
        picture: (height, width, 3) uint8 BGR.
        mask: (height, width) uint8, 255 on the foreground, else 0.
    """

    picture: Image
    mask: Image

    def cut(self, box: Fragment) -> tuple[slice, slice]:
        """Return the rows and columns of a box inside the picture; they may be none."""
        height, width = self.mask.shape
        left, top = max(0, round(box.left)), max(0, round(box.top))
        right, bottom = min(width, round(box.right)), min(height, round(box.bottom))
        return slice(top, max(top, bottom)), slice(left, max(left, right))


class Appearance:
    """A template of an object that adapts to it, and histograms of its colours.

    The probability of each pixel to belong to the object is part of the template, as in A. Senior
    et al., "Appearance models for occlusion handling", 2006.
    """

    def __init__(self) -> None:
        self.template: NDArray[np.float32] | None = None
        self.seen: NDArray[np.float32] | None = None
        self.histogram: NDArray[np.float32] | None = None

    def learn(self, scene: Scene, box: Fragment, share: float) -> None:
        """Adapt to what a box shows.

        Args:
            scene: The frame.
            box: Where the object is, alone.
            share: Weight of this frame, 0 to 1; the first one counts as a whole.
        """
        cut = scene.cut(box)
        picture, mask = scene.picture[cut], scene.mask[cut]
        if min(mask.shape) < 2:
            return
        colors = picture.astype(np.float32)
        seen = mask.astype(np.float32) * (1 / 255)
        histogram = histogram_of(picture, mask)
        if self.template is None or self.seen is None or self.histogram is None:
            self.template, self.seen, self.histogram = colors, seen, histogram
            return
        height, width = mask.shape
        if self.seen.shape != mask.shape:
            self.template = np.asarray(cv2.resize(self.template, (width, height)), np.float32)
            self.seen = np.asarray(cv2.resize(self.seen, (width, height)), np.float32)
        weight = (share * seen / np.maximum(self.seen, share))[:, :, np.newaxis]
        self.template = np.asarray(self.template * (1 - weight) + colors * weight, np.float32)
        self.seen = self.seen * (1 - share) + seen * share
        self.histogram = self.histogram * np.float32(1 - share) + histogram * np.float32(share)

    def distance(self, scene: Scene, box: Fragment) -> float:
        """Return how different the colours in a box are: 0 the same, 1 none in common."""
        cut = scene.cut(box)
        mask = scene.mask[cut]
        if self.histogram is None or not mask.size:
            return 0.5
        other = histogram_of(scene.picture[cut], mask)
        common = float(np.sqrt(self.histogram * other).sum()) / 2
        return math.sqrt(max(0.0, 1.0 - common))

    def costs(
        self, scene: Scene, left: int, top: int, reach_x: int, reach_y: int
    ) -> NDArray[np.float64] | None:
        """Return how badly the template fits at each place around a box.

        Args:
            scene: The frame; pixels that another object covers are not in its mask.
            left: Of the template's box, in the middle of the search.
            top: As left.
            reach_x: How far to search to each side.
            reach_y: As reach_x.

        Returns:
            (2 reach_y + 1, 2 reach_x + 1), the mean cost of a pixel of the object: about 0 where
            it fits, 1 and more where it does not. None without a template.
        """
        if self.template is None or self.seen is None:
            return None
        height, width = self.seen.shape
        weight = np.square(self.seen)
        total = float(weight.sum())
        if total < 4:
            return None
        window = Fragment(
            left - reach_x, top - reach_y, left + width + reach_x, top + height + reach_y, 0
        )
        rows, columns = scene.cut(window)
        size = (height + 2 * reach_y, width + 2 * reach_x)
        colors = np.zeros((*size, 3), np.float32)
        free = np.zeros(size, np.float32)
        if rows.stop > rows.start and columns.stop > columns.start:
            y, x = rows.start - (top - reach_y), columns.start - (left - reach_x)
            inside = (
                slice(y, y + rows.stop - rows.start),
                slice(x, x + columns.stop - columns.start),
            )
            colors[inside] = scene.picture[rows, columns]
            free[inside] = scene.mask[rows, columns] * np.float32(1 / 255)
        # Sum over the template of weight * (free * squared difference + (1 - free) * cost)
        colored = colors * free[:, :, np.newaxis]
        squares = (np.square(colors).sum(axis=2)) * free
        correlate = cv2.TM_CCORR
        template = self.template * weight[:, :, np.newaxis]
        own = np.square(self.template).sum(axis=2) * weight
        difference = (
            cv2.matchTemplate(squares, weight, correlate)
            - 2 * cv2.matchTemplate(colored, template, correlate)
            + cv2.matchTemplate(free, own.astype(np.float32), correlate)
        ) / (3 * COLOR_DEVIATION**2)
        unseen = total - cv2.matchTemplate(free, weight, correlate)
        return np.asarray((difference + UNSEEN_COST * unseen) / total, np.float64)


def histogram_of(picture: Image, mask: Image) -> NDArray[np.float32]:
    """Return the colours of the upper and the lower half of an object, each with the sum 1.

    Args:
        picture: (height, width, 3) uint8 BGR.
        mask: (height, width) uint8, not 0 on the object.
    """
    middle = max(1, mask.shape[0] // 2)
    parts = []
    for rows in (slice(0, middle), slice(middle, None)):
        if mask[rows].size:
            counts = cv2.calcHist(
                [picture[rows]], [0, 1, 2], mask[rows], [BINS] * 3, [0, 256] * 3
            ).ravel()
        else:
            counts = np.zeros(BINS**3, np.float32)
        parts.append(counts / max(1.0, float(counts.sum())))
    return np.asarray(np.concatenate(parts), np.float32)
