"""A connected region of the foreground: an object, a part of one, or several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Region(NamedTuple):
    """A region of the foreground mask; all lengths in pixels of that mask."""

    left: float  # first column of its bounding box
    top: float  # first row of its bounding box
    right: float  # column after the last one of its bounding box
    bottom: float  # row after the last one of its bounding box
    area: float  # area in square pixels
    # Mean position x, y of its pixels, which jitters less than the edges of its box; None if
    # unknown.
    pixels_at: tuple[float, float] | None = None
    # The connected regions of which it was joined; empty if it is one.
    parts: tuple[Region, ...] = ()

    @property
    def width(self) -> float:
        """Width of the bounding box."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height of the bounding box."""
        return self.bottom - self.top

    @property
    def center(self) -> tuple[float, float]:
        """Centre of the bounding box, x, y."""
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2

    def scaled(self, factor: float) -> Region:
        """Return its bounding box and area in pixels of a picture of another size."""
        left, top, right, bottom = (factor * edge for edge in self[:4])
        return Region(left, top, right, bottom, factor * factor * self.area)

    def moved(self, x: float, y: float) -> Region:
        """Return its bounding box and area at another place."""
        edges = self.left + x, self.top + y, self.right + x, self.bottom + y
        return Region(*edges, self.area)


def union(regions: Sequence[Region]) -> Region:
    """Return one region with the bounding box and the total area of several."""
    if len(regions) == 1:
        return regions[0]
    area = sum(each.area for each in regions)
    known = [(each.area, each.pixels_at) for each in regions if each.pixels_at is not None]
    pixels_at = None
    if len(known) == len(regions) and area > 0:
        x, y = (sum(share * at[axis] for share, at in known) / area for axis in (0, 1))
        pixels_at = x, y
    return Region(
        min(each.left for each in regions),
        min(each.top for each in regions),
        max(each.right for each in regions),
        max(each.bottom for each in regions),
        area,
        pixels_at,
        tuple(part for each in regions for part in each.parts or (each,)),
    )


def extent(profile: NDArray[np.int_], thin: float) -> tuple[int, int]:
    """Return the range, end exclusive, from the first to the last column or row not thin.

    Args:
        profile: The number of pixels in each column or row.
        thin: Those with less than this share of the fullest one are thin.
    """
    enough = np.flatnonzero(profile >= thin * profile.max())
    return int(enough[0]), int(enough[-1]) + 1
