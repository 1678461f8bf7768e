"""The tracked objects, their ids, and the time by the frames' stamps."""

from __future__ import annotations

from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.target import Target, new_target

MAX_TARGETS = 400
"""Further objects are not tracked, so that the time for a frame is bounded."""


class Targets:
    """All tracked objects of one camera.

    Args:
        size: Width and height of the mask.
        first_id: Id of the first object; each further one gets the next number.

    Attributes:
        all: The objects, oldest first.
        next_id: Id of the next new object.
        now_ns: Time by which the stamps have advanced since the first one. It never goes back.
    """

    def __init__(self, size: tuple[int, int], first_id: int) -> None:
        self.all: list[Target] = []
        self.next_id = first_id
        self.size = size
        self.now_ns = 0
        self._stamp_ns: int | None = None

    def pass_time(self, stamp_ns: int) -> float:
        """Return the seconds since the last frame; 0 if its stamp is later than this one."""
        step_ns = 0 if self._stamp_ns is None else max(0, stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        self.now_ns += step_ns
        return step_ns / 1e9

    def since_s(self, then_ns: int) -> float:
        """Return the seconds since a value of ``now_ns``."""
        return (self.now_ns - then_ns) / 1e9

    def begin(self, fragment: Fragment) -> Target | None:
        """Begin to track a fragment as a new object; None if ``MAX_TARGETS`` are tracked."""
        if len(self.all) >= MAX_TARGETS:
            return None
        target = new_target(self.next_id, fragment, self.now_ns)
        self.next_id += 1
        self.all.append(target)
        target.full = not self.at_border(fragment)
        target.cut = not target.full
        return target

    def drop(self, number: int) -> None:
        """Stop tracking the object with this id."""
        self.all = [each for each in self.all if each.id != number]

    def at_border(self, box: Fragment) -> bool:
        """Return whether a box reaches the border of the picture, which may cut it off."""
        width, height = self.size
        return box.left <= 1 or box.top <= 1 or box.right >= width - 1 or box.bottom >= height - 1

    def outside(self, target: Target) -> bool:
        """Return whether most of an object is expected outside of the picture."""
        width, height = self.size
        return not (0 < target.x.position < width and 0 < target.y.position < height)

    def leaving(self, target: Target) -> bool:
        """Return whether an object is expected at the border, or outside of it."""
        return self.outside(target) or self.at_border(target.box)
