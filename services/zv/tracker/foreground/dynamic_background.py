"""Models a background that keeps changing: leaves in the wind, water, flickering screens."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

TEST_EVERY_S = 0.15
"""At 30, 10 and 5 Hz, tests are then 0.17, 0.2 and 0.2 s apart."""

CHANGE, PER_S = 10, 5
"""Each change between background and foreground adds ``CHANGE`` to the count of a pixel; each
second subtracts ``PER_S``. Only a pixel that changes more than once in 2 s can become dynamic."""

DYNAMIC = 60
"""From this count on, a pixel is dynamic; a person who walks past adds 20 to 40."""

LIGHT_SHARE = 0.25
"""If a larger share of the picture changes at once, the light has changed."""

KEEP_EVERY_S = 0.5
KEPT = 20
"""Number of pictures of the last seconds that are kept; each pixel of them is a sample."""

LEAST_ALIKE = 2
"""A colour belongs to the background if at least this many samples have it."""


class DynamicBackground:
    """Finds the pixels whose background keeps changing, and keeps samples of their colours.

    A pixel is dynamic if it keeps changing between background and foreground. Known objects count
    neither as changes nor as samples, so an object that stands still stays foreground.

    Sources: P.-L. St-Charles et al., "SuBSENSE: a universal change detection method with local
    adaptive sensitivity", 2015, for the count of changes; O. Barnich, M. Van Droogenbroeck, "ViBe:
    a universal background subtraction algorithm for video sequences", 2011, for the samples.
    """

    def __init__(self) -> None:
        self._counts: Image = np.zeros((0, 0), np.uint8)
        self._before: Image | None = None
        self._tested_ns = self._since_ns = 0
        self._samples: Image = np.zeros((0, 0, 0, 3), np.uint8)
        self._kept = 0  # number of pictures kept so far
        self._kept_ns = 0
        self._remainder = 0.0  # fraction of a count, to be subtracted later
        self._places: NDArray[np.intp] = np.zeros(0, np.intp)  # of dynamic pixels

    @property
    def changes(self) -> Image | None:
        """The count of changes of each pixel, (height, width) uint8; None before two pictures."""
        return self._counts if self._counts.size else None

    @property
    def counted_s(self) -> float:
        """For how long changes have been counted."""
        return (self._tested_ns - self._since_ns) / 1e9

    def unmark(self, picture: Image, limits: Image, marked: Image) -> None:
        """Set the mask to 0 at dynamic pixels that have one of their usual colours.

        Args:
            picture: (height, width, 3) uint8 BGR.
            limits: Of the same shape, the difference up to which two values are the same.
            marked: (height, width) uint8, not 0 where the picture differs from the background;
                modified.
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
        """Count the changes of a picture, and keep it as samples, if these are due.

        Args:
            picture: (height, width, 3) uint8 BGR.
            marked: (height, width) uint8, not 0 where the picture differs from the background,
                before ``unmark``.
            known: (height, width) uint8, 255 at known objects, else 0; None without.
            stamp_ns: When the picture was taken. Stamps that go backwards restart the intervals.
            background: (height, width, 3) uint8 BGR, used behind the known objects.
        """
        elapsed_s = (stamp_ns - self._tested_ns) / 1e9
        if self._before is not None and 0 <= elapsed_s < TEST_EVERY_S:
            return
        differs = np.asarray(cv2.threshold(marked, 0, 255, cv2.THRESH_BINARY)[1], np.uint8)
        if self._before is None:
            self._counts = np.zeros_like(marked)
        if self._before is None or elapsed_s < 0:
            self._before, self._tested_ns, self._kept_ns = differs, stamp_ns, stamp_ns
            self._since_ns = stamp_ns
            return
        changed = differs ^ self._before
        if known is not None:
            cv2.subtract(changed, known, changed)
        if cv2.countNonZero(changed) > LIGHT_SHARE * changed.size:
            changed[:] = 0
        more = cv2.add(self._counts, changed & np.uint8(CHANGE))
        whole, self._remainder = divmod(self._remainder + PER_S * elapsed_s, 1)
        less = np.full_like(changed, min(255, int(whole)))
        self._counts = np.asarray(cv2.subtract(more, less), np.uint8)
        self._before, self._tested_ns = differs, stamp_ns
        self._places = np.flatnonzero(self._counts >= DYNAMIC)
        if not self._kept or stamp_ns - self._kept_ns >= KEEP_EVERY_S * 1e9:
            self._keep(picture, known, background)
            self._kept_ns = stamp_ns

    def forget_colours(self) -> None:
        """Forget the samples, but not which pixels are dynamic: the light has changed."""
        self._kept = 0

    def _keep(self, picture: Image, known: Image | None, background: Image) -> None:
        """Keep a picture as samples; where an object hides the background, the old sample stays.

        If there is no old sample, the colour of ``background`` is used.
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
