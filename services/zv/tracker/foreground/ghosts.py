"""Finds ghosts: foreground where an object has left but is still in the learned background."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.background import SHADOW, BackgroundModel
from zv.tracker.foreground.fragments import fragments_of
from zv.tracker.foreground.lighting import same_texture
from zv.tracker.tracking.fragment import Fragment

Image = NDArray[np.uint8]

TEST_EVERY_S = 0.25
STILL_PICTURES = 3
"""A pixel is still if it has not changed since this many earlier tests."""

KNOWN_TIMES = 4
"""Number of tests in a row that must find a ghost at a known object."""

LEAST_AREA = 10.0
"""Least area of a ghost, square pixels."""

GHOST_SHARE = 0.3
"""A region is a ghost if its ``picture_share`` is smaller."""

FREE_SHARE = 0.5
"""Least share of a still region's outline that must border on background."""

LIKELY = 0.5
"""A region is also a ghost if its ``picture_share`` is below this and its texture correlates with
the background's by more than this: the outline of a faint ghost alone is not enough evidence."""

BACKGROUND_TEXTURE = 0.8
"""A region whose texture correlates with the background's by more than this, and whose difference
in colour is uneven, is background that was learned while an object half covered it."""

EVEN = 0.95
"""Above this ``evenness`` of the difference, the region may be an object of a similar colour."""

SIDE = 7
"""Side of the square window in which colours on both sides of the outline are compared, pixels."""

BAND = np.ones((5, 5), np.uint8)
"""Width of the outline: a mask may end one or two pixels beside the edge in the picture."""


class GhostFinder:
    """Tests the unchanging parts of the foreground for ghosts, every quarter of a second.

    Since only these parts are tested, a ghost is found even while the object that left it is still
    in the same region.
    """

    def __init__(self) -> None:
        self._before: list[Image] = []
        self._times: Image | None = None
        self._tested_ns: int | None = None

    def due(self, stamp_ns: int) -> bool:
        """Return whether a test is due; stamps that go backwards start anew."""
        if self._tested_ns is not None and stamp_ns < self._tested_ns:
            self._before, self._times, self._tested_ns = [], None, None
        return self._tested_ns is None or stamp_ns - self._tested_ns >= TEST_EVERY_S * 1e9

    def update(
        self,
        picture: Image,
        model: BackgroundModel,
        marked: Image,
        known: Image | None,
        stamp_ns: int,
    ) -> Image | None:
        """Test a frame and return the mask of its ghosts.

        A ghost that is tracked as an object must be found several times in a row.

        Args:
            picture: (height, width, 3) uint8 BGR.
            model: The background model.
            marked: (height, width) uint8, 255 foreground, 127 shadow, else 0.
            known: (height, width) uint8, not 0 at known objects; None without.
            stamp_ns: When the picture was taken.

        Returns:
            (height, width) uint8, not 0 on ghosts and on background that was learned half
            covered; None without either.
        """
        before, self._tested_ns = self._before, stamp_ns
        self._before = [*before[1 - STILL_PICTURES :], picture.copy()]
        if len(before) < STILL_PICTURES:
            return None
        cleaned = np.asarray(cv2.medianBlur(marked, 3), np.uint8)  # without single pixels
        _, mask = cv2.threshold(cleaned, 0, 255, cv2.THRESH_BINARY)
        places = np.flatnonzero(cleaned > SHADOW)
        places = places[model.alike_at(places, picture, before)]
        still = np.zeros_like(marked)
        still.reshape(-1)[places] = 255
        # Fill holes where an object has the background's colour by chance.
        still, mask = (
            np.asarray(cv2.morphologyEx(each, cv2.MORPH_CLOSE, BAND), np.uint8)
            for each in (cv2.medianBlur(still, 3), mask)
        )
        ghosts, same = np.zeros_like(marked), np.zeros_like(marked)
        background = model.picture()
        for window, own in _components(still):
            shown, expected, around = picture[window], background[window], mask[window]
            for region in fragments_of(own, LEAST_AREA, math.inf):
                inside = _cut(region, 0)
                where = own[inside]
                texture = same_texture(expected[inside], shown[inside], where)
                share = picture_share(shown, expected, around, own, region)
                if share < GHOST_SHARE or (share < LIKELY and texture > LIKELY):
                    ghosts[window][inside] |= where
                elif texture > BACKGROUND_TEXTURE and (
                    evenness(shown[inside], expected[inside], where) < EVEN
                ):
                    same[window][inside] |= where
        # Pixels beside a ghost are background; those beside background that was learned half
        # covered may be the object that covers it.
        ghosts = np.asarray(cv2.dilate(ghosts, BAND), np.uint8) | same
        if not ghosts.any():
            self._times = None
            return None
        ghosts = self._sure(ghosts, known)
        return ghosts if ghosts.any() else None

    def _sure(self, ghosts: Image, known: Image | None) -> Image:
        """Return the ghosts outside of known objects, and those found often enough inside."""
        if self._times is None:
            self._times = np.zeros_like(ghosts)
        more = cv2.add(self._times, np.ones_like(ghosts))  # at most 255
        self._times = np.asarray(cv2.bitwise_and(more, ghosts), np.uint8)
        if known is None:
            return ghosts
        return np.where((known == 0) | (self._times >= KNOWN_TIMES), ghosts, np.uint8(0))


def picture_share(
    picture: Image, background: Image, mask: Image, still: Image, box: Fragment
) -> float:
    """Return to what extent the outline of a region is an edge in the picture: about 0 to 1.

    The difference of picture and background has a step across the outline of the region. The step
    is in the picture if it shows a new object, or in the background if that still shows an object
    that has left. It is the difference of the two pictures' steps. The result is the picture's
    share of it: the projection of the picture's step onto the difference, divided by the squared
    norm of the difference. Steps are measured in the mean colours and in their standard
    deviations, so that a plain object before a textured background is not mistaken for a ghost.

    Args:
        picture: (height, width, 3) uint8 BGR.
        background: The same.
        mask: (height, width) uint8 of 0 and 255, the foreground.
        still: The same, the unchanging part of the foreground that contains the region.
        box: Bounding box of the region.

    Returns:
        1 for a new object, 0 for a ghost. Also 1 if most of the region is surrounded by other
        foreground, so that this cannot be measured.
    """
    cut = _cut(box, SIDE)
    around, free = _outline(still[cut]), _outline(mask[cut])
    outline = around & free
    if np.count_nonzero(outline) < FREE_SHARE * np.count_nonzero(around):
        return 1.0
    inside, outside = still[cut] > 0, mask[cut] == 0
    shown = _step(picture[cut], inside, outside, outline)
    step = shown - _step(background[cut], inside, outside, outline)
    total = float(np.vdot(step, step))
    return float(np.vdot(shown, step)) / total if total > 0 else 1.0


def evenness(picture: Image, background: Image, where: Image) -> float:
    """Return how much of the difference of two pictures is the same everywhere: 0 to 1.

    Args:
        picture: (height, width, 3) uint8 BGR.
        background: The same.
        where: (height, width) uint8, not 0 where they are compared.
    """
    off = (picture.astype(np.float32) - background)[where > 0]
    mean = off.mean(axis=0)
    total = float(np.vdot(off, off)) / len(off)
    return float(np.vdot(mean, mean)) / total if total > 0 else 1.0


def _step(
    picture: Image,
    inside: NDArray[np.bool_],
    outside: NDArray[np.bool_],
    where: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Return the steps across an outline at its n pixels, (n, 6).

    They are the differences, inside minus outside, of the means and the standard deviations of the
    three colours.
    """
    found = []
    for side in (inside, outside):
        weights = side.astype(np.float32)
        colours = picture * weights[:, :, np.newaxis]
        counts, sums, squares = (
            cv2.boxFilter(each, cv2.CV_32F, (SIDE, SIDE), normalize=False)[where]
            for each in (weights, colours, colours * picture)
        )
        counts = np.maximum(counts, 1.0)[:, np.newaxis]
        means = sums / counts
        deviations = np.sqrt(np.maximum(squares / counts - means * means, 0.0))
        found.append(np.concatenate([means, deviations], axis=1))
    return np.asarray(found[0] - found[1], np.float32)


def _components(still: Image) -> Iterator[tuple[tuple[slice, slice], Image]]:
    """Return each connected component of a mask: a window around it, and its pixels in there.

    Another component may lie in its bounding box: an object in the angle of an L.
    """
    # Labels and outlines take a ninth of the time of connectedComponentsWithStats.
    _, labels = cv2.connectedComponents(still)
    outlines, levels = cv2.findContours(still, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    for outline, (*_, parent) in zip(outlines, [] if levels is None else levels[0], strict=True):
        left, top, width, height = cv2.boundingRect(outline)
        if parent >= 0 or width * height < LEAST_AREA:  # a hole, or too small
            continue
        window = _cut(Fragment(left, top, left + width, top + height, 0), SIDE)
        x, y = outline[0, 0]
        own = labels[window] == labels[y, x]
        yield window, own.view(np.uint8) * np.uint8(255)


def _outline(region: Image) -> NDArray[np.bool_]:
    return np.asarray(cv2.subtract(cv2.dilate(region, BAND), cv2.erode(region, BAND))) > 0


def _cut(box: Fragment, margin: int) -> tuple[slice, slice]:
    return (
        slice(max(0, int(box.top) - margin), int(box.bottom) + margin),
        slice(max(0, int(box.left) - margin), int(box.right) + margin),
    )
