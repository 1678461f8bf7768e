"""The state of one tracked object."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

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
"""Factor of the error where only one edge was seen, and the centre is computed from the size."""

SHOWN_S = 0.3
"""A confirmed track that is not seen for longer than this is lost."""

PATH_S = 0.6
"""For how long the places in which a new object was seen are kept."""

MOST_PLACES = 128
"""Largest number of places kept; at any usual frame rate, all places of ``PATH_S``."""

SIZE_TIME_S = 0.7
"""Time constant with which the size follows a change."""


@dataclass(slots=True, eq=False)
class Target:
    """The state of one tracked object; lengths in pixels of the mask, times of ``Targets.now_ns``.

    Attributes:
        id: The id of its track.
        x: Filter of the centre of its box along x.
        y: Filter of the centre of its box along y.
        width: Width of its box, smoothed over time.
        height: Height of its box, smoothed over time.
        area: Area of its foreground, smoothed over time.
        born_ns: When it was first seen.
        seen_ns: When it was last seen.
        origin: The box in which it was first seen.
        cut: Whether that box was at the border of the picture, and so perhaps incomplete.
        hits: Number of frames in which it was seen.
        seen_s: Time for which it was seen, of the time since it was first seen.
        path: Times and places of the last ``PATH_S`` in which it was seen, until it is confirmed.
        travelled: Largest distance from its origin, in sides.
        confirmed: Whether it was ever confirmed.
        grouped_ns: When it last shared a fragment with others; None if that is long ago.
        parted_ns: Since when it has looked like two objects; None if it does not.
        moved_ns: When it was last seen moving.
        learned_ns: When its appearance was last learned.
        stacked_ns: Since when it has been on top of an older object in a group, or below it; None
            if it is not.
        clear_ns: When some of the foreground was last clearly its own.
        alone_s: For how long it was seen alone, complete, away from the border of the picture.
        full: Whether it was ever seen away from the border of the picture.
        whole: Largest width and height in which it was seen from end to end; they fade while it
            is seen so again, and are 0 if it never was.
        turned_to: Where it was found in this frame, in the region of other objects, before its
            pixels there are known; None if it is expected where its motion leads.
        shown: Its own foreground in this frame, if that seems to be all of it.
        steady: A point of the object as measured in this frame; None if it was not measured. It
            moves with the object even while the object enters the picture, when the centre of the
            part in view is slower.
        offset: From ``steady`` to the centre, x and y.
        shift: From the mean position of its pixels to ``steady``; None if unknown.
        appearance: Its silhouette and colours.
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
    seen_s: float = 0.0
    path: list[tuple[int, Point]] = field(default_factory=list)
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
    turned_to: Point | None = None
    shown: Fragment | None = None
    steady: Point | None = None
    offset: Point = (0.0, 0.0)
    shift: Point | None = None
    appearance: Appearance = field(default_factory=Appearance)

    @property
    def side(self) -> float:
        """Side of the square with the area of its box, at least 2."""
        return max(2.0, math.sqrt(self.width * self.height))

    @property
    def box(self) -> Fragment:
        """Its box, measured or expected."""
        x, y = self.turned_to or (self.x.position, self.y.position)
        half_width, half_height = self.width / 2, self.height / 2
        return Fragment(x - half_width, y - half_height, x + half_width, y + half_height, self.area)

    @property
    def speed(self) -> float:
        """Its speed, sides per second."""
        return math.hypot(self.x.velocity, self.y.velocity) / self.side

    def predict(self, dt_s: float) -> None:
        """Predict its state some seconds ahead, to the stamp of the next frame."""
        self.shown = self.steady = self.turned_to = None
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
        """Correct the state by a measured centre, less along an axis where that is not sure."""
        side = self.side
        deviation = NOISE_SIDES * side + NOISE_PIXELS
        for axis, position, is_sure in zip((self.x, self.y), measured, sure, strict=True):
            if is_sure:
                axis.adapt(position, deviation)
                axis.correct(position, deviation)
            else:
                axis.correct(position, UNSURE * deviation)
        self.turned_to = None
        self.steady = _minus(measured, self.offset)
        self.seen_ns = stamp_ns
        self.hits += 1
        self.travelled = max(self.travelled, self._distance() / side)

    def remember(self, now_ns: int, dt_s: float) -> None:
        """Add a frame to the time for which a new object was seen, and to its path."""
        if self.seen_ns != now_ns:
            return
        if self.born_ns != now_ns:
            self.seen_s += dt_s
        if self.path and self.path[-1][0] == now_ns:
            return  # no time has passed
        kept = self.path[1 - MOST_PLACES :]
        self.path = [each for each in kept if now_ns - each[0] <= PATH_S * 1e9]
        if self.steady is not None:
            self.path.append((now_ns, self.steady))
        elif not self.cut:  # else the first part in view had another centre
            self.path.append((now_ns, (self.x.position, self.y.position)))

    def unsteadiness(self) -> float:
        """Return how far its path is from a steady motion: root mean square distance, in sides.

        Infinite with fewer than three places, through which there is always a steady motion.
        """
        if len(self.path) < 3:
            return math.inf
        times = np.array([stamp_ns for stamp_ns, _ in self.path], float) / 1e9
        places = np.array([place for _, place in self.path])
        times -= times.mean()
        places -= places.mean(axis=0)
        velocity = times @ places / max(float(times @ times), 1e-9)
        off = places - np.outer(times, velocity)
        return math.sqrt(float(np.mean(np.sum(off * off, axis=1)))) / self.side

    def place_at(self, center: Point) -> None:
        """Set the centre, which changed with the size, without changing the velocity."""
        assert self.steady is not None
        self.x.position, self.y.position = center
        self.offset, self.shift = _minus(center, self.steady), None

    def steadied(self, center: Point, pixels_at: Point, share: float) -> Point:
        """Return the centre of its box, estimated from the mean position of all its pixels.

        The edges of the box move by whole pixels, and by more if noise or JPEG blocks add pixels.
        The usual offset between the two positions is learned with the weight ``share``, 0 to 1.
        """
        if self.shift is None:
            self.shift = _minus(_minus(center, self.offset), pixels_at)
        steady = pixels_at[0] + self.shift[0], pixels_at[1] + self.shift[1]
        more = _minus(_minus(center, steady), self.offset)
        self.offset = self.offset[0] + share * more[0], self.offset[1] + share * more[1]
        return steady[0] + self.offset[0], steady[1] + self.offset[1]

    def _distance(self) -> float:
        """Return the distance from its origin.

        Growing or shrinking is not a motion, so along an axis both edges must have moved in the
        same direction. One that entered the picture has moved by as much as its edge inside, since
        the centre of the part in view moves by half of that.
        """
        box, origin = self.box, self.origin
        if self.cut:
            return math.dist(self.steady or box.center, origin.center)
        along_x = _both(box.left - origin.left, box.right - origin.right)
        along_y = _both(box.top - origin.top, box.bottom - origin.bottom)
        return math.hypot(along_x, along_y)

    def resize(self, width: float, height: float, area: float, share: float) -> None:
        """Move the size towards a measured one, by the weight ``share`` from 0 to 1."""
        self.width += (width - self.width) * share
        self.height += (height - self.height) * share
        self.area += (area - self.area) * share

    def become(self, found: Fragment) -> None:
        """Take a box that shows all of the object, without changing the velocity."""
        self.resize(found.width, found.height, found.area, 1.0)
        moved = _minus(found.center, self.box.center)
        self.offset = self.offset[0] + moved[0], self.offset[1] + moved[1]
        self.x.position, self.y.position = found.center
        self.turned_to = self.shift = None

    def missing_s(self, stamp_ns: int) -> float:
        """Return the seconds since it was last seen."""
        return max(0.0, (stamp_ns - self.seen_ns) / 1e9)


def _minus(one: Point, other: Point) -> Point:
    return one[0] - other[0], one[1] - other[1]


def _both(low: float, high: float) -> float:
    return min(abs(low), abs(high)) if low * high > 0 else 0.0


def new_target(number: int, fragment: Fragment, stamp_ns: int) -> Target:
    """Return the state of an object that was seen for the first time, as a fragment."""
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
