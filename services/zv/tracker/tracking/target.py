"""The state of one object while it is followed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from zv.tracker.tracking.appearance import Appearance
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.kalman import AxisFilter

ACCELERATION = 1.5
"""Standard deviation of the acceleration, sides of the object per square second."""

SPEED = 1.5
"""Standard deviation of the speed of a new object, sides per second."""

NOISE_SIDES, NOISE_PIXELS = 0.05, 0.5
SIZE_TIME_S = 0.7
"""Time after which the size has followed a change by 63 %."""


@dataclass(slots=True)
class Target:
    """One object that is followed; lengths in pixels of the mask.

    Attributes:
        id: Its number.
        x: Of the middle of its box.
        y: As x.
        width: Of its box.
        height: As width.
        area: Of its foreground.
        born_ns: When it was seen first.
        seen_ns: When it was seen last.
        origin: The box in which it was first.
        cut: Whether that was at the border of the picture, and so perhaps incomplete.
        hits: Frames in which it was seen.
        travelled: Farthest distance from its origin, in sides.
        confirmed: Whether it was ever.
        group: Ids of those that it shared a fragment with when it was last seen.
        grouped_ns: When that was; None if it is alone.
        parted_ns: Since when it seems to be two objects; None if it does not.
        moved_ns: When it was last found moving.
        learned_ns: When its appearance was last learned.
        ghost: How often it was taken for a ghost.
        full: Whether it was ever seen away from the border of the picture.
        shown: Its own foreground in this frame, if that seems to be all of it.
        appearance: What it looks like.
    """

    id: int
    x: AxisFilter
    y: AxisFilter
    width: float
    height: float
    area: float
    born_ns: int
    seen_ns: int
    origin: Fragment
    cut: bool = False
    hits: int = 1
    travelled: float = 0.0
    confirmed: bool = False
    group: frozenset[int] = frozenset()
    grouped_ns: int | None = None
    parted_ns: int | None = None
    moved_ns: int = 0
    learned_ns: int = 0
    ghost: int = 0
    full: bool = False
    shown: Fragment | None = None
    appearance: Appearance = field(default_factory=Appearance)

    @property
    def side(self) -> float:
        """Of the square with its box's area."""
        return max(2.0, math.sqrt(self.width * self.height))

    @property
    def box(self) -> Fragment:
        """Where it is, or is expected."""
        x, y = self.x.position, self.y.position
        half_width, half_height = self.width / 2, self.height / 2
        return Fragment(x - half_width, y - half_height, x + half_width, y + half_height, self.area)

    @property
    def speed(self) -> float:
        """Sides per second."""
        return math.hypot(self.x.velocity, self.y.velocity) / self.side

    def predict(self, dt_s: float) -> None:
        """Go on for some seconds."""
        acceleration = ACCELERATION * self.side
        self.x.predict(dt_s, acceleration)
        self.y.predict(dt_s, acceleration)

    def slow_down(self, factor: float) -> None:
        """Multiply its velocity by a factor."""
        self.x.velocity *= factor
        self.y.velocity *= factor

    def correct(self, measured: tuple[float, float], stamp_ns: int, factor: float = 1.0) -> None:
        """Include a measured middle, with a deviation of ``factor`` times the usual one."""
        deviation = factor * (NOISE_SIDES * self.side + NOISE_PIXELS)
        self.x.correct(measured[0], deviation)
        self.y.correct(measured[1], deviation)
        self.seen_ns = stamp_ns
        self.hits += 1
        self.travelled = max(self.travelled, self._distance() / self.side)

    def _distance(self) -> float:
        """Return how far it is from where it was first: what only grows or shrinks has not moved.

        So both edges along an axis must have moved the same way.
        """
        box, origin = self.box, self.origin
        if self.cut:
            (x, y), (x0, y0) = box.center, origin.center
            return math.hypot(x - x0, y - y0)
        along_x = _both(box.left - origin.left, box.right - origin.right)
        along_y = _both(box.top - origin.top, box.bottom - origin.bottom)
        return math.hypot(along_x, along_y)

    def resize(self, width: float, height: float, area: float, share: float) -> None:
        """Let the size follow a measured one by a share from 0 to 1."""
        self.width += (width - self.width) * share
        self.height += (height - self.height) * share
        self.area += (area - self.area) * share

    def missing_s(self, stamp_ns: int) -> float:
        """Seconds since it was seen."""
        return max(0.0, (stamp_ns - self.seen_ns) / 1e9)


def _both(low: float, high: float) -> float:
    return min(abs(low), abs(high)) if low * high > 0 else 0.0


def new_target(number: int, fragment: Fragment, stamp_ns: int) -> Target:
    """Return an object that was seen for the first time."""
    x, y = fragment.center
    side = max(2.0, math.sqrt(fragment.width * fragment.height))
    noise = (NOISE_SIDES * side + NOISE_PIXELS) ** 2
    speed = (SPEED * side) ** 2
    return Target(
        id=number,
        x=AxisFilter(x, 0.0, noise, 0.0, speed),
        y=AxisFilter(y, 0.0, noise, 0.0, speed),
        width=fragment.width,
        height=fragment.height,
        area=fragment.area,
        born_ns=stamp_ns,
        seen_ns=stamp_ns,
        origin=fragment,
        moved_ns=stamp_ns,
    )
