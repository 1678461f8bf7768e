"""Pixels whose background has several colours: leaves in the wind, water, a flickering screen."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

TEST_EVERY_S = 0.15
"""At 30, 10 and 5 Hz tests are then 0.17, 0.2 and 0.2 s apart."""

CHANGE, PER_S = 10, 5
"""What a change between background and other adds to the count of a pixel, and what a second takes
away: only a pixel that changes more than once in 2 s is ever restless."""

RESTLESS = 60
"""From this count on a pixel is restless; who walks past adds 20 to 40."""

LIGHT_SHARE = 0.25
"""If a larger share of the picture changes at once, it is the light."""

KEEP_EVERY_S = 0.5
KEPT = 20
"""So many pictures of the last seconds are kept; each pixel of them is a sample."""

LEAST_ALIKE = 2
"""A colour that occurs so often among the samples is one of the background's."""


class RestlessPixels:
    """Knows the pixels that keep changing, and the colours that they have had.

    Only pixels that keep changing between background and something else are treated so, and what is
    known as an object counts neither as a change nor as a sample: who stands stays visible.

    Sources: P.-L. St-Charles et al., "SuBSENSE: a universal change detection method with local
    adaptive sensitivity", 2015, for the count of changes; O. Barnich, M. Van Droogenbroeck, "ViBe:
    a universal background subtraction algorithm for video sequences", 2011, for the samples.
    """

    def __init__(self) -> None:
        self._counts: Image = np.zeros((0, 0), np.uint8)
        self._before: Image | None = None
        self._tested_ns = 0
        self._samples: Image = np.zeros((0, 0, 0, 3), np.uint8)
        self._kept = 0  # so many pictures so far
        self._kept_ns = 0
        self._owed = 0.0  # of what seconds take away, the part below one
        self._places: NDArray[np.intp] = np.zeros(0, np.intp)

    @property
    def changes(self) -> Image | None:
        """The count of changes of each pixel, (height, width) uint8; None before two pictures."""
        return self._counts if self._counts.size else None

    def leave_out(self, picture: Image, limits: Image, marked: Image) -> None:
        """Take away the marks of restless pixels that have one of their usual colours.

        Args:
            picture: (height, width, 3) uint8 BGR.
            limits: Of the same shape, how far each value may be off.
            marked: (height, width) uint8, not 0 where the picture differs from the background.
        """
        places = self._places
        if not places.size or not self._kept:
            return
        places = places[marked.reshape(-1)[places] > 0]
        shown, allowed = (each.reshape(-1, 3).take(places, axis=0) for each in (picture, limits))
        samples = self._samples[: self._kept].reshape(-1, marked.size, 3).take(places, axis=1)
        near = np.maximum(samples, shown) - np.minimum(samples, shown) <= allowed
        alike = (near[:, :, 0] & near[:, :, 1] & near[:, :, 2]).sum(axis=0)
        marked.reshape(-1)[places[alike >= LEAST_ALIKE]] = 0

    def learn(
        self, picture: Image, marked: Image, known: Image | None, stamp_ns: int, background: Image
    ) -> None:
        """Count changes, and keep samples.

        Args:
            picture: (height, width, 3) uint8 BGR.
            marked: (height, width) uint8, not 0 where the picture differs from the background,
                before ``leave_out``.
            known: (height, width) uint8, 255 where an object is known to be, else 0; None for
                nowhere.
            stamp_ns: When it was taken. Stamps that go backwards start the intervals anew.
            background: (height, width, 3) uint8 BGR, what is behind the known objects.
        """
        elapsed_s = (stamp_ns - self._tested_ns) / 1e9
        if self._before is not None and 0 <= elapsed_s < TEST_EVERY_S:
            return
        differs = np.asarray(cv2.threshold(marked, 0, 255, cv2.THRESH_BINARY)[1], np.uint8)
        if self._before is None:
            self._counts = np.zeros_like(marked)
        if self._before is None or elapsed_s < 0:
            self._before, self._tested_ns, self._kept_ns = differs, stamp_ns, stamp_ns
            return
        changed = differs ^ self._before
        if known is not None:
            cv2.subtract(changed, known, changed)
        if cv2.countNonZero(changed) > LIGHT_SHARE * changed.size:
            changed[:] = 0
        more = cv2.add(self._counts, changed & np.uint8(CHANGE))
        whole, self._owed = divmod(self._owed + PER_S * elapsed_s, 1)
        less = np.full_like(changed, min(255, int(whole)))
        self._counts = np.asarray(cv2.subtract(more, less), np.uint8)
        self._before, self._tested_ns = differs, stamp_ns
        self._places = np.flatnonzero(self._counts >= RESTLESS)
        if not self._kept or stamp_ns - self._kept_ns >= KEEP_EVERY_S * 1e9:
            self._keep(picture, known, background)
            self._kept_ns = stamp_ns

    def forget_colours(self) -> None:
        """Keep which pixels are restless, but not their colours: the light has changed."""
        self._kept = 0

    def _keep(self, picture: Image, known: Image | None, background: Image) -> None:
        """Keep a picture as samples; where an object hides the background, an older one stays.

        Without an older one it is the colour of the background.
        """
        if self._samples.shape[1:] != picture.shape:
            self._samples = np.empty((KEPT, *picture.shape), np.uint8)
        sample = self._samples[self._kept % KEPT]
        if self._kept < KEPT:
            sample[:] = background
        if known is None:
            sample[:] = picture
        else:
            cv2.copyTo(picture, cv2.bitwise_not(known), sample)
        self._kept += 1
