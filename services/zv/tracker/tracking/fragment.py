"""A connected region of the foreground: an object, a part of one, or several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Fragment(NamedTuple):
    """A region of the foreground mask; all lengths in pixels of that mask.

    Attributes:
        left: First column of its bounding box.
        top: First row of its bounding box.
        right: Column after the last one of its bounding box.
        bottom: Row after the last one of its bounding box.
        area: Area in square pixels.
        pixels_at: Mean position x, y of its pixels, which jitters less than the edges of its box;
            None if unknown.
    """

    left: float
    top: float
    right: float
    bottom: float
    area: float
    pixels_at: tuple[float, float] | None = None

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


def union(fragments: Sequence[Fragment]) -> Fragment:
    """Return one fragment with the bounding box and the total area of several."""
    if len(fragments) == 1:
        return fragments[0]
    area = sum(each.area for each in fragments)
    known = [(each.area, each.pixels_at) for each in fragments if each.pixels_at is not None]
    pixels_at = None
    if len(known) == len(fragments) and area > 0:
        x, y = (sum(share * at[axis] for share, at in known) / area for axis in (0, 1))
        pixels_at = x, y
    return Fragment(
        min(each.left for each in fragments),
        min(each.top for each in fragments),
        max(each.right for each in fragments),
        max(each.bottom for each in fragments),
        area,
        pixels_at,
    )
