"""Finds ghosts: places of things that have left, which the learned background still shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.fragment import Fragment

Image = NDArray[np.uint8]

TEST_EVERY_S = 0.25
TESTS = 2
"""So many tests in a row must find a ghost, at the same place."""

SAME_PLACE = 0.7
"""Least intersection over union of the boxes of a region that has not moved between two tests."""

GHOST_SHARE = 0.4
"""A region is a ghost if its outline belongs to the picture by a smaller share."""

BAND = np.ones((5, 5), np.uint8)
"""The outline is so wide, since a mask ends a pixel or two beside the edge that causes it."""


@dataclass(slots=True)
class _Candidate:
    """A region that was there at the last test, and how often it was found to be a ghost."""

    box: Fragment
    votes: int = 0


class GhostFinder:
    """Tests regions of the foreground that do not move, every quarter of a second."""

    def __init__(self) -> None:
        self._candidates: list[_Candidate] = []
        self._tested_ns: int | None = None

    def due(self, stamp_ns: int) -> bool:
        """Return whether it is time for a test; stamps that go backwards start anew."""
        if self._tested_ns is not None and stamp_ns < self._tested_ns:
            self._candidates, self._tested_ns = [], None
        return self._tested_ns is None or stamp_ns - self._tested_ns >= TEST_EVERY_S * 1e9

    def update(
        self,
        picture: Image,
        background: Image,
        mask: Image,
        fragments: Sequence[Fragment],
        stamp_ns: int,
    ) -> list[Fragment]:
        """Test the regions of a frame, and return those that are ghosts.

        Args:
            picture: (height, width, 3) uint8 BGR.
            background: The same.
            mask: (height, width) uint8 of 0 and 255.
            fragments: Its regions.
            stamp_ns: When it was taken.
        """
        before, self._candidates = self._candidates, []
        self._tested_ns = stamp_ns
        ghosts = []
        for fragment in fragments:
            candidate = _Candidate(fragment)
            known = next((each for each in before if _same(each.box, fragment)), None)
            if known is not None and picture_share(picture, background, mask, fragment) < (
                GHOST_SHARE
            ):
                candidate.votes = known.votes + 1
            if candidate.votes >= TESTS:
                ghosts.append(fragment)
            else:
                self._candidates.append(candidate)
        return ghosts


def picture_share(picture: Image, background: Image, mask: Image, box: Fragment) -> float:
    """Return by which share the outline of a region is an edge of the picture: about 0 to 1.

    Across the outline the difference of picture and background has a step. It is one of the
    picture, if something is there that the background does not have, or one of the background, if
    that remembers something that has left. The step's gradient is the difference of both pictures'
    gradients, so the projection of the picture's gradient onto it, divided by its square, is the
    picture's share, and the rest is the background's.

    Args:
        picture: (height, width, 3) uint8 BGR.
        background: The same.
        mask: (height, width) uint8 of 0 and 255.
        box: Around the region.
    """
    margin = BAND.shape[0]
    cut = (
        slice(max(0, int(box.top) - margin), int(box.bottom) + margin),
        slice(max(0, int(box.left) - margin), int(box.right) + margin),
    )
    region = mask[cut]
    outline = cv2.subtract(cv2.dilate(region, BAND), cv2.erode(region, BAND)) > 0
    own = total = 0.0
    for dx in (0, 1):
        shown = cv2.Sobel(picture[cut], cv2.CV_32F, dx, 1 - dx)[outline]
        step = shown - cv2.Sobel(background[cut], cv2.CV_32F, dx, 1 - dx)[outline]
        own += float(np.vdot(shown, step))
        total += float(np.vdot(step, step))
    return own / total if total > 0 else 1.0


def _same(one: Fragment, other: Fragment) -> bool:
    width = min(one.right, other.right) - max(one.left, other.left)
    height = min(one.bottom, other.bottom) - max(one.top, other.top)
    if width <= 0 or height <= 0:
        return False
    shared = width * height
    both = one.width * one.height + other.width * other.height - shared
    return shared >= SAME_PLACE * both
