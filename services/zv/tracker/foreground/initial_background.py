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
    shown, counted = [_planes(pictures[at]) for at in places], [free[at] for at in places]
    alike = [each.copy() for each in counted]
    for one in range(len(shown)):
        for two in range(one):
            same = cv2.min(_same(shown[one], shown[two]), cv2.min(counted[one], counted[two]))
            cv2.add(alike[one], same, alike[one])
            cv2.add(alike[two], same, alike[two])
    best, most = shown[0].copy(), alike[0].copy()
    for planes, votes in zip(shown[1:], alike[1:], strict=True):
        more = cv2.compare(votes, most, cv2.CMP_GT)
        for plane, kept in zip(planes, best, strict=True):
            cv2.copyTo(plane, more, kept)
        cv2.max(votes, most, most)
    total, count = np.zeros(best.shape, np.float32), np.zeros(best.shape[1:], np.uint8)
    for planes, counts in zip(shown, counted, strict=True):
        same = cv2.min(_same(planes, best), counts)
        for plane, plane_total in zip(planes, total, strict=True):
            cv2.accumulate(plane, plane_total, mask=same)
        cv2.add(count, same, count)
    mean = np.rint(total / np.maximum(count, 1)).astype(np.uint8)
    found = np.asarray(cv2.merge(list(mean)), np.uint8)
    _, few = cv2.threshold(count, LEAST_ALIKE - 1, 255, cv2.THRESH_BINARY_INV)
    cv2.copyTo(_middle(pictures), few, found)
    return found


def _planes(picture: Image) -> Image:
    """Return a picture as (3, height, width): OpenCV compares planes three times as fast."""
    return np.array(cv2.split(picture), np.uint8)


def _same(one: Image, other: Image) -> Image:
    """Return where two pictures in planes have the same colour: (height, width), 255 or 0."""
    width = one.shape[2]
    apart = cv2.absdiff(one.reshape(-1, width), other.reshape(-1, width)).reshape(one.shape)
    most = cv2.max(cv2.max(apart[0], apart[1]), apart[2])
    return np.asarray(cv2.threshold(most, ALIKE, 255, cv2.THRESH_BINARY_INV)[1], np.uint8)


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
