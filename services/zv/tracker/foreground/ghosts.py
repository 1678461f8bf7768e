"""Finds ghosts: places of things that have left, which the learned background still shows."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.background import BackgroundModel
from zv.tracker.foreground.fragments import fragments_of
from zv.tracker.tracking.fragment import Fragment

Image = NDArray[np.uint8]

TEST_EVERY_S = 0.25
STILL_PICTURES = 3
"""A pixel is still if it is alike in so many pictures before, one from each test."""

LEAST_AREA = 40.0
"""Of a ghost, pixels."""

GHOST_SHARE = 0.3
"""A region is a ghost if its outline belongs to the picture by a smaller share."""

FREE_SHARE = 0.5
"""Least share of the outline of a still region beside which there is no foreground."""

BAND = np.ones((5, 5), np.uint8)
"""The outline is so wide, since a mask ends a pixel or two beside the edge that causes it."""


class GhostFinder:
    """Tests the parts of the foreground that do not change, every quarter of a second.

    So a ghost is found while what has left it is still beside it, in the same region.
    """

    def __init__(self) -> None:
        self._before: list[Image] = []
        self._tested_ns: int | None = None

    def due(self, stamp_ns: int) -> bool:
        """Return whether it is time for a test; stamps that go backwards start anew."""
        if self._tested_ns is not None and stamp_ns < self._tested_ns:
            self._before, self._tested_ns = [], None
        return self._tested_ns is None or stamp_ns - self._tested_ns >= TEST_EVERY_S * 1e9

    def update(
        self, picture: Image, model: BackgroundModel, mask: Image, stamp_ns: int
    ) -> Image | None:
        """Test a frame, and return where its ghosts are, (height, width), not 0; None for nowhere.

        Args:
            picture: (height, width, 3) uint8 BGR.
            model: Of the background.
            mask: (height, width) uint8 of 0 and 255.
            stamp_ns: When it was taken.
        """
        before, self._tested_ns = self._before, stamp_ns
        self._before = [*before[1 - STILL_PICTURES :], picture.copy()]
        if len(before) < STILL_PICTURES:
            return None
        places = np.flatnonzero(mask > 0)
        places = places[model.alike_at(places, picture, before)]
        still = np.zeros_like(mask)
        still.reshape(-1)[places] = 255
        still = np.asarray(cv2.medianBlur(still, 3), np.uint8)
        ghosts = np.zeros_like(mask)
        for region in fragments_of(still, LEAST_AREA, math.inf):
            if picture_share(picture, model.picture(), mask, still, region) < GHOST_SHARE:
                inside = _cut(region, 0)
                ghosts[inside] = still[inside]
        return np.asarray(cv2.dilate(ghosts, BAND), np.uint8) if ghosts.any() else None


def picture_share(
    picture: Image, background: Image, mask: Image, still: Image, box: Fragment
) -> float:
    """Return by which share the outline of a region is an edge of the picture: about 0 to 1.

    Across the outline the difference of picture and background has a step. It is one of the
    picture, if something is there that the background does not have, or one of the background, if
    that remembers something that has left. The step's gradient is the difference of both pictures'
    gradients, so the projection of the picture's gradient onto it, divided by its square, is the
    picture's share, and the rest is the background's.

    Args:
        picture: (height, width, 3) uint8 BGR.
        background: The same.
        mask: (height, width) uint8 of 0 and 255, the foreground.
        still: The same, the part of it that contains the region.
        box: Around the region.

    Returns:
        1 if most of the region is surrounded by other foreground, so that nothing can be said.
    """
    cut = _cut(box, BAND.shape[0])
    around, free = _outline(still[cut]), _outline(mask[cut])
    outline = around & free
    if np.count_nonzero(outline) < FREE_SHARE * np.count_nonzero(around):
        return 1.0
    own = total = 0.0
    for dx in (0, 1):
        shown = cv2.Sobel(picture[cut], cv2.CV_32F, dx, 1 - dx)[outline]
        step = shown - cv2.Sobel(background[cut], cv2.CV_32F, dx, 1 - dx)[outline]
        own += float(np.vdot(shown, step))
        total += float(np.vdot(step, step))
    return own / total if total > 0 else 1.0


def _outline(region: Image) -> NDArray[np.bool_]:
    return np.asarray(cv2.subtract(cv2.dilate(region, BAND), cv2.erode(region, BAND))) > 0


def _cut(box: Fragment, margin: int) -> tuple[slice, slice]:
    return (
        slice(max(0, int(box.top) - margin), int(box.bottom) + margin),
        slice(max(0, int(box.left) - margin), int(box.right) + margin),
    )
