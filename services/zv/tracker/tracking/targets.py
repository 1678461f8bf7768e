"""The objects that are followed, with their ids and a clock that their stamps drive."""

from __future__ import annotations

from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.target import Target, new_target

MAX_TARGETS = 400
"""More are left out, so that the time for a frame has a bound."""


class Targets:
    """All objects of one camera that are followed, oldest first.

    Args:
        size: Width and height of the mask.
        first_id: Of the first object; each further one gets the next number.

    Attributes:
        all: In the order in which they were begun.
        next_id: Of the next new object.
        now_ns: Time that the stamps have advanced since the first one. It never goes back.
    """

    def __init__(self, size: tuple[int, int], first_id: int) -> None:
        self.all: list[Target] = []
        self.next_id = first_id
        self.size = size
        self.now_ns = 0
        self._stamp_ns: int | None = None

    def pass_time(self, stamp_ns: int) -> float:
        """Return the seconds since the last frame; after a step back, count on from there."""
        step_ns = 0 if self._stamp_ns is None else max(0, stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        self.now_ns += step_ns
        return step_ns / 1e9

    def since_s(self, then_ns: int) -> float:
        """Return the seconds since a time of the clock."""
        return (self.now_ns - then_ns) / 1e9

    def begin(self, fragment: Fragment) -> Target | None:
        """Follow what was found as a new object; None if there are too many already."""
        if len(self.all) >= MAX_TARGETS:
            return None
        target = new_target(self.next_id, fragment, self.now_ns)
        self.next_id += 1
        self.all.append(target)
        target.full = not self.at_border(fragment)
        target.cut = not target.full
        return target

    def drop(self, number: int) -> None:
        """Follow the object with this id no more."""
        self.all = [each for each in self.all if each.id != number]

    def at_border(self, box: Fragment) -> bool:
        """Return whether a box reaches the border of the picture, where it may be cut."""
        width, height = self.size
        return box.left <= 1 or box.top <= 1 or box.right >= width - 1 or box.bottom >= height - 1

    def leaving(self, target: Target) -> bool:
        """Return whether an object is expected at the border, or outside of it."""
        width, height = self.size
        x, y = target.x.position, target.y.position
        return not (0 < x < width and 0 < y < height) or self.at_border(target.box)
