"""The background of the first seconds, found behind the objects that move in them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

FOUND_AT_S = (1.0, 2.0, 3.0, 4.5)
"""Ages at which the background is found from the pictures so far."""

KEEP_EVERY_S = 0.25

COMPARED = 9
"""So many pictures are compared at most, from the first to the last."""

ALIKE = 20
"""Two values of a pixel are of the same colour if no colour differs by more grey levels."""

LEAST_ALIKE = 3
"""A pixel had a colour for long enough if so many pictures show it."""


class Beginning:
    """Keeps pictures of the first seconds, and finds the background from them.

    Args:
        picture: The first one, (height, width, 3) uint8 BGR.
        stamp_ns: When it was taken.
    """

    def __init__(self, picture: Image, stamp_ns: int) -> None:
        self._started_ns = self._kept_ns = stamp_ns
        self._pictures = [picture.copy()]
        self._free = [np.ones(picture.shape[:2], np.uint8)]
        self._found = 0

    @property
    def over(self) -> bool:
        """Whether the background is found, so that no more pictures are needed."""
        return self._found == len(FOUND_AT_S)

    def update(
        self, picture: Image, stamp_ns: int, known: Image | None, background: Image
    ) -> Image | None:
        """Take a picture, and return the background if it is time to find it, else None.

        Args:
            picture: (height, width, 3) uint8 BGR.
            stamp_ns: When it was taken.
            known: (height, width) uint8, not 0 where an object is known to be; None for nowhere.
            background: The background so far.
        """
        if self.over:
            return None
        if stamp_ns - self._kept_ns >= KEEP_EVERY_S * 1e9:
            seen, free = picture.copy(), np.ones(picture.shape[:2], np.uint8)
            if known is not None:
                cv2.copyTo(background, known, seen)
                free[known > 0] = 0
            self._pictures.append(seen)
            self._free.append(free)
            self._kept_ns = stamp_ns
        age_s = (stamp_ns - self._started_ns) / 1e9
        if age_s < FOUND_AT_S[self._found]:
            return None
        while not self.over and age_s >= FOUND_AT_S[self._found]:
            self._found += 1  # once for all that are due, as after a pause
        enough = len(self._pictures) >= LEAST_ALIKE
        return usual_colours(self._pictures, self._free) if enough else None

    def replace(self, picture: Image, where: Image) -> None:
        """Forget what was seen where a mask, (height, width) uint8, is not 0; that is a picture's.

        Args:
            picture: (height, width, 3) uint8 BGR.
            where: The mask.
        """
        for seen in self._pictures:
            cv2.copyTo(picture, where, seen)


def usual_colours(pictures: Sequence[Image], free: Sequence[Image]) -> Image:
    """Return the colour that each pixel had in most pictures, though not in most of the time.

    Who walks slowly hides a place for longer than it is seen, but shows there one colour after the
    other, while the background's is always the same. So the colour is the mean of the largest
    number of values that are alike. Where there are too few of these, it is the median.

    Args:
        pictures: (height, width, 3) uint8 BGR, from first to last; at least 3.
        free: Of each picture, (height, width) uint8, 0 where it does not count, else 1. It counts
            for the median.
    """
    places = sorted({round(at) for at in np.linspace(0, len(pictures) - 1, COMPARED)})
    shown, counted = [pictures[at] for at in places], [free[at] for at in places]
    alike = np.array(counted)
    for one in range(len(shown)):
        for two in range(one):
            both = cv2.min(counted[one], counted[two])
            same = np.asarray(cv2.min(_same(shown[one], shown[two]), both), np.uint8)
            alike[one] += same
            alike[two] += same
    best = np.take_along_axis(np.array(shown), alike.argmax(axis=0)[None, :, :, None], axis=0)[0]
    total, count = np.zeros(best.shape, np.float32), np.zeros(best.shape[:2], np.uint8)
    for picture, counts in zip(shown, counted, strict=True):
        same = np.asarray(cv2.min(_same(picture, best), counts), np.uint8)
        cv2.accumulate(picture, total, mask=same)
        count += same
    found = np.rint(total / np.maximum(count, 1)[:, :, None]).astype(np.uint8)
    enough = (count >= LEAST_ALIKE)[:, :, None]
    return np.asarray(np.where(enough, found, _middle(pictures)), np.uint8)


def _same(one: Image, other: Image) -> Image:
    """Return where two pictures are alike, (height, width), 255 there, else 0."""
    apart = cv2.absdiff(one, other)
    return np.asarray(cv2.inRange(apart, (0.0, 0.0, 0.0), (float(ALIKE),) * 3), np.uint8)


def _middle(pictures: Sequence[Image]) -> Image:
    """Return about the median of each value of some pictures, at least 3, from first to last.

    It is the median of the medians of three of nine pictures, which are taken from different
    times, so that a value that is there for most of the time is found (J. W. Tukey, "The ninther",
    1978). It costs a twentieth of a sort.
    """
    nine = [pictures[round(place)] for place in np.linspace(0, len(pictures) - 1, 9)]
    thirds = [_median(*nine[first::3]) for first in range(3)]
    return _median(*thirds)


def _median(one: Image, two: Image, three: Image) -> Image:
    larger, smaller = cv2.max(one, two), cv2.min(one, two)
    return np.asarray(cv2.max(smaller, cv2.min(larger, three)), np.uint8)
