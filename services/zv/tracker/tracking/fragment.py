"""A connected region of the foreground, which may be an object, a part of one, or several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Fragment(NamedTuple):
    """A region of the foreground mask; all lengths in pixels of that mask.

    Attributes:
        left: Of its bounding box, as are the others.
        top: Smaller than ``bottom``.
        right: The first column that does not belong to it.
        bottom: The first row that does not belong to it.
        area: In square pixels.
        pixels_at: Mean position of its pixels, which shakes less than the edges of its box; None
            if it is not known.
    """

    left: float
    top: float
    right: float
    bottom: float
    area: float
    pixels_at: tuple[float, float] | None = None

    @property
    def width(self) -> float:
        """Of its box."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Of its box."""
        return self.bottom - self.top

    @property
    def center(self) -> tuple[float, float]:
        """Of its box."""
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2


def union(fragments: Sequence[Fragment]) -> Fragment:
    """Return one fragment with the box around several, and the sum of their areas."""
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
