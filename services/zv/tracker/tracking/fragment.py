"""A connected region of the foreground, which may be an object, a part of one, or several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Fragment:
    """A region of the foreground mask; all lengths in pixels of that mask.

    Attributes:
        left: Of its bounding box, as are the others.
        top: Smaller than ``bottom``.
        right: The first column that does not belong to it.
        bottom: The first row that does not belong to it.
        area: In square pixels.
    """

    left: float
    top: float
    right: float
    bottom: float
    area: float

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
    return Fragment(
        min(each.left for each in fragments),
        min(each.top for each in fragments),
        max(each.right for each in fragments),
        max(each.bottom for each in fragments),
        sum(each.area for each in fragments),
    )
