"""The state of one object while it is followed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from zv.tracker.tracking.appearance import Appearance
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.kalman import AxisFilter

Point = tuple[float, float]

ACCELERATION = 1.5
"""Standard deviation of the acceleration, sides of the object per square second."""

SPEED = 1.5
"""Standard deviation of the speed of a new object, sides per second."""

NOISE_SIDES, NOISE_PIXELS = 0.05, 0.5
UNSURE = 4.0
"""The error of a middle that is concluded from one edge is so many times as large."""

SHOWN_S = 0.3
"""A confirmed track that is not seen for so long is lost."""

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
        grouped_ns: When it last shared a fragment with others; None if that is long ago.
        parted_ns: Since when it seems to be two objects; None if it does not.
        moved_ns: When it was last found moving.
        learned_ns: When its appearance was last learned.
        stacked_ns: Since when it is on top of an older one in a group, or below; None if it is not.
        clear_ns: When some of the foreground was last clearly its own.
        alone_s: For how long it was seen alone, complete, away from the border of the picture.
        full: Whether it was ever seen away from the border of the picture.
        whole: Width and height that it had when it was last seen from end to end; they fade, and
            are 0 if it never was.
        shown: Its own foreground in this frame, if that seems to be all of it.
        steady: A point of the object as measured in this frame, which moves as the object does
            even while that enters the picture and its middle does not; None if it was not measured.
        offset: From there to the middle, x and y.
        shift: From the mean position of its pixels to there; None if that is not known.
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
    grouped_ns: int | None = None
    parted_ns: int | None = None
    moved_ns: int = 0
    learned_ns: int = 0
    stacked_ns: int | None = None
    clear_ns: int = 0
    alone_s: float = 0.0
    full: bool = False
    whole: Point = (0.0, 0.0)
    shown: Fragment | None = None
    steady: Point | None = None
    offset: Point = (0.0, 0.0)
    shift: Point | None = None
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
        """Go on for some seconds, to a frame in which it has not been seen yet."""
        self.shown = self.steady = None
        acceleration = ACCELERATION * self.side
        self.x.predict(dt_s, acceleration)
        self.y.predict(dt_s, acceleration)

    def slow_down(self, factor: float) -> None:
        """Multiply its velocity by a factor."""
        self.x.velocity *= factor
        self.y.velocity *= factor

    def correct(
        self, measured: Point, stamp_ns: int, sure: tuple[bool, bool] = (True, True)
    ) -> None:
        """Include a measured middle, less along an axis of which that is not sure."""
        side = self.side
        deviation = NOISE_SIDES * side + NOISE_PIXELS
        for axis, position, is_sure in zip((self.x, self.y), measured, sure, strict=True):
            if is_sure:
                axis.adapt(position, deviation)
                axis.correct(position, deviation)
            else:
                axis.correct(position, UNSURE * deviation)
        self.steady = _minus(measured, self.offset)
        self.seen_ns = stamp_ns
        self.hits += 1
        self.travelled = max(self.travelled, self._distance() / side)

    def place_at(self, middle: Point) -> None:
        """Move the middle, without a motion of the object, to where it is by another size."""
        assert self.steady is not None
        self.x.position, self.y.position = middle
        self.offset, self.shift = _minus(middle, self.steady), None

    def steadied(self, middle: Point, pixels_at: Point, share: float) -> Point:
        """Return the middle of its box by the mean position of all its pixels.

        An edge of the box moves by whole pixels, and by more where noise or the blocks of a JPEG
        add some to it. What is usual between both places is learned by a share from 0 to 1.
        """
        if self.shift is None:
            self.shift = _minus(_minus(middle, self.offset), pixels_at)
        steady = pixels_at[0] + self.shift[0], pixels_at[1] + self.shift[1]
        more = _minus(_minus(middle, steady), self.offset)
        self.offset = self.offset[0] + share * more[0], self.offset[1] + share * more[1]
        return steady[0] + self.offset[0], steady[1] + self.offset[1]

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

    def become(self, found: Fragment) -> None:
        """Take the box of what was found to be all of it, without a motion of the object."""
        self.resize(found.width, found.height, found.area, 1.0)
        self.x.position, self.y.position = found.center
        self.shift = None

    def missing_s(self, stamp_ns: int) -> float:
        """Seconds since it was seen."""
        return max(0.0, (stamp_ns - self.seen_ns) / 1e9)


def _minus(one: Point, other: Point) -> Point:
    return one[0] - other[0], one[1] - other[1]


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
        clear_ns=stamp_ns,
    )
