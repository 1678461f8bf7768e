"""Estimates the background from the first seconds, behind the objects that move in them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

FOUND_AT_S = (1.0, 2.0, 3.0, 4.5)
"""Times since the first picture at which the background is estimated from the pictures so far."""

KEEP_EVERY_S = 0.25

COMPARED = 9
"""Largest number of pictures that are compared, evenly spaced from the first to the last."""

ALIKE = 20
"""Two colours are the same if no channel differs by more than this, grey levels."""

LEAST_ALIKE = 3
"""A colour may be the background's if at least this many pictures show it."""


class InitialBackground:
    """Keeps pictures of the first seconds, and estimates the background from them.

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
        """Whether the last estimate was made, so that no more pictures are needed."""
        return self._found == len(FOUND_AT_S)

    def update(
        self, picture: Image, stamp_ns: int, known: Image | None, background: Image
    ) -> Image | None:
        """Add a picture; return the background if an estimate is due, else None.

        Args:
            picture: (height, width, 3) uint8 BGR.
            stamp_ns: When it was taken.
            known: (height, width) uint8, not 0 at known objects; None without.
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
            self._found += 1  # several may be due after a pause; they are made at once
        enough = len(self._pictures) >= LEAST_ALIKE
        return usual_colours(self._pictures, self._free) if enough else None

    def replace(self, picture: Image, where: Image) -> None:
        """Replace a part of all kept pictures by that of another picture.

        Args:
            picture: (height, width, 3) uint8 BGR.
            where: (height, width) uint8, not 0 in that part.
        """
        for seen in self._pictures:
            cv2.copyTo(picture, where, seen)


def usual_colours(pictures: Sequence[Image], free: Sequence[Image]) -> Image:
    """Return the colour that the largest number of pictures agree on at each pixel.

    A person who walks slowly may hide a place in most of the pictures, but in changing colours,
    while the background's colour stays the same. The result is therefore the mean of the largest
    set of similar values. If that has fewer than ``LEAST_ALIKE`` values, the result is a median of
    all pictures.

    Args:
        pictures: (height, width, 3) uint8 BGR, from first to last; at least 3.
        free: Of each picture, (height, width) uint8, 0 where it is ignored, else 1; the median
            ignores nothing.

    Returns:
        (height, width, 3) uint8 BGR.
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
    """Return where two pictures have the same colour: (height, width), 255 there, else 0."""
    apart = cv2.absdiff(one, other)
    return np.asarray(cv2.inRange(apart, (0.0, 0.0, 0.0), (float(ALIKE),) * 3), np.uint8)


def _middle(pictures: Sequence[Image]) -> Image:
    """Return the approximate median of each value of at least 3 pictures, from first to last.

    It is the ninther (J. W. Tukey, "The ninther", 1978): the median of the medians of three groups
    of three pictures, each taken from different times. It costs a twentieth of a sort.
    """
    nine = [pictures[round(place)] for place in np.linspace(0, len(pictures) - 1, 9)]
    thirds = [_median(*nine[first::3]) for first in range(3)]
    return _median(*thirds)


def _median(one: Image, two: Image, three: Image) -> Image:
    larger, smaller = cv2.max(one, two), cv2.min(one, two)
    return np.asarray(cv2.max(smaller, cv2.min(larger, three)), np.uint8)
