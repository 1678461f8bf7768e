"""The state of one tracked object."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking.appearance import Floats, Image
from zv.tracker.tracking.boxes import IMPOSSIBLE
from zv.tracker.tracking.kalman import AxisFilter
from zv.tracker.tracking.region import Region

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """The constants of motion and size; sides are those of the object's box, seconds of stamps."""

    acceleration: float = 1.5  # standard deviation of the acceleration, sides per square second
    speed: float = 1.5  # standard deviation of the speed of a new object, sides per second
    noise_sides: float = 0.05  # standard deviation of a measured centre, sides,
    noise_px: float = 0.5  # plus pixels
    unsure: float = 4.0  # factor of that deviation where only one edge was seen
    size_s: float = 0.7  # time constant with which the size follows a change, seconds
    # An object stands while its centre stays within this distance, smaller sides.
    still: float = 0.2
    # What comes nearer grows, so that its edges move by different amounts: its centre has moved at
    # most this many times as far as the slower edge.
    slower: float = 3.0


MOTION = MotionLimits()


@dataclass(slots=True, eq=False)
class TrackState:
    """The state of one tracked object; lengths in pixels of the mask, times by the stamps."""

    id: int
    x: AxisFilter  # filter of the centre of its box along x
    y: AxisFilter  # filter of the centre of its box along y
    width: float  # width of its box, smoothed over time
    height: float  # height of its box, smoothed over time
    area: float  # area of its foreground, smoothed over time
    born_s: float  # when it was first seen
    seen_s: float  # when it was last seen
    origin: Region  # the box in which it was first seen
    # Whether its left, top, right and bottom edge was then at the border of the picture, which may
    # hide the rest.
    cut: tuple[bool, ...]
    stands_at: Point  # where it stands, or stood last
    stands_s: float  # since when it has stood there
    shown_s: float = 0.0  # for how long it was seen, of the time since it was first seen
    hits: int = 1  # number of frames in which it was seen
    travelled: float = 0.0  # largest distance from its origin, in smaller sides of its box
    confirmed: bool = False  # whether it was ever confirmed
    # Whether it shares a region with others, or did so and another is still near.
    grouped: bool = False
    tested_s: float = 0.0  # when it was last tested for being a ghost
    # What of the picture was in its box then, and where that is: rows and columns.
    tested: tuple[Image, tuple[slice, slice]] | None = None
    changed_s: float = 0.0  # when it was last tested and what is in its box had changed
    learned_s: float = 0.0  # when its colours were last learned
    alone_s: float = 0.0  # for how long it was seen alone, less what sharing a region took away
    was_inside: bool = False  # whether it was ever seen away from the border of the picture
    came_in: bool = False  # whether it was first seen at the border of where objects are detected
    shown: Region | None = None  # its own foreground in this frame, if that seems to be all of it
    # A point of the object as measured in this frame; None if it was not measured. It moves with
    # the object even while the object enters the picture, when the centre of the part in view is
    # slower.
    steady: Point | None = None
    offset: Point = (0.0, 0.0)  # from ``steady`` to the centre, x and y
    # From the mean position of its pixels to ``steady``; None if unknown.
    shift: Point | None = None
    colors: Floats | None = None  # as ``appearance.learned`` returns them
    class_name: str | None = None  # name of its class, if a model says it
    score: float | None = None  # how sure the model was when it last found it

    @classmethod
    def new(
        cls, number: int, found: Region, now_s: float, cut: tuple[bool, ...] = (False,) * 4
    ) -> Self:
        """Return the state of an object that was seen for the first time; ``cut`` as above."""
        x, y = found.center
        side = max(2.0, math.sqrt(found.width * found.height))
        noise = (MOTION.noise_sides * side + MOTION.noise_px) ** 2
        speed = (MOTION.speed * side) ** 2
        return cls(
            id=number,
            x=AxisFilter(x, 0.0, noise, 0.0, speed),
            y=AxisFilter(y, 0.0, noise, 0.0, speed),
            width=found.width,
            height=found.height,
            area=found.area,
            born_s=now_s,
            seen_s=now_s,
            origin=found,
            cut=cut,
            was_inside=not any(cut),
            came_in=any(cut),
            stands_at=(x, y),
            stands_s=now_s,
        )

    @property
    def side(self) -> float:
        """Side of the square with the area of its box, at least 2."""
        return max(2.0, math.sqrt(self.width * self.height))

    @property
    def smaller_side(self) -> float:
        """The smaller of width and height, at least 2."""
        return max(2.0, min(self.width, self.height))

    @property
    def box(self) -> Region:
        """Its box, measured or expected."""
        x, y = self.x.position, self.y.position
        half_width, half_height = self.width / 2, self.height / 2
        return Region(x - half_width, y - half_height, x + half_width, y + half_height, self.area)

    @property
    def speed(self) -> float:
        """Its speed, sides per second."""
        return math.hypot(self.x.velocity, self.y.velocity) / self.side

    def predict(self, dt_s: float) -> None:
        """Predict its state some seconds ahead, to the stamp of the next frame."""
        self.shown = self.steady = None
        acceleration = MOTION.acceleration * self.side
        self.x.predict(dt_s, acceleration)
        self.y.predict(dt_s, acceleration)

    def slow_down(self, factor: float) -> None:
        """Multiply its velocity by a factor."""
        self.x.velocity *= factor
        self.y.velocity *= factor

    def correct(
        self, measured: Point, now_s: float, sure: tuple[bool, bool] = (True, True)
    ) -> None:
        """Correct the state by a measured centre, less along an axis where that is not sure."""
        deviation = MOTION.noise_sides * self.side + MOTION.noise_px
        for axis, position, is_sure in zip((self.x, self.y), measured, sure, strict=True):
            if is_sure:
                axis.adapt(position, deviation)
                axis.correct(position, deviation)
            else:
                axis.correct(position, MOTION.unsure * deviation)
        self.steady = _minus(measured, self.offset)
        self.seen_s = now_s
        self.hits += 1
        self.travelled = max(self.travelled, self._distance() / self.smaller_side)
        place = self.x.position, self.y.position
        if math.dist(place, self.stands_at) > MOTION.still * self.smaller_side:
            self.stands_at, self.stands_s = place, now_s

    def place_at(self, center: Point) -> None:
        """Set the centre, which changed with the size, without changing the velocity."""
        assert self.steady is not None
        self.x.position, self.y.position = center
        self.offset, self.shift = _minus(center, self.steady), None

    def rest(self) -> None:
        """Measure the distance that it travels from where it is now."""
        self.origin, self.travelled, self.cut = self.shown or self.box, 0.0, (False,) * 4

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

        Growing or shrinking alone is not a motion, so along an axis both edges must have moved in
        the same direction. Where one was at the border of the picture it must have come in, by the
        edge inside.
        """
        box, origin = self.box, self.origin
        moved = [now - then for now, then in zip(box[:4], origin[:4], strict=True)]
        left, top, right, bottom = self.cut
        return math.hypot(
            _way(moved[0], moved[2], left, right), _way(moved[1], moved[3], top, bottom)
        )

    def costs(
        self, regions: Sequence[Region], center: Point, gate_sides: float, log_area: float
    ) -> NDArray[np.float64]:
        """Return what it costs that it is each of some regions, by distance and area.

        Those farther from the expected centre than twice a gate in sides and the uncertainty of its
        place, or with another logarithm of the area, are ``IMPOSSIBLE``.
        """
        reach, found = gate_sides / 2 * self.side, np.array([each.center for each in regions])
        away = np.square((found[:, 0] - center[0]) / (math.sqrt(self.x.pp) + reach))
        away += np.square((found[:, 1] - center[1]) / (math.sqrt(self.y.pp) + reach))
        areas = np.array([each.area for each in regions])
        ratio = np.abs(np.log((areas + 1) / (self.area + 1)))
        return np.where((away < 4.0) & (ratio < log_area), away + ratio, IMPOSSIBLE)

    def resize(self, width: float, height: float, area: float, share: float) -> None:
        """Move the size towards a measured one, by the weight ``share`` from 0 to 1."""
        self.width += (width - self.width) * share
        self.height += (height - self.height) * share
        self.area += (area - self.area) * share

    def missing_s(self, now_s: float) -> float:
        """Return the seconds since it was last seen."""
        return max(0.0, now_s - self.seen_s)


@dataclass(slots=True, eq=False)
class BoxState(TrackState):
    """The state of an object that a model finds; lengths in pixels of the picture."""

    found: float = 0.0  # number of runs of the model that were sure of it; clear ones count more
    missed: int = 0  # number of runs that did not find it, since the last that did
    evidence: dict[str, float] = field(default_factory=dict)  # sum of its scores by class, fading
    # Its region of motion in the last frame; None if it had none of its own.
    motion: Region | None = None
    place: Point = (0.0, 0.0)  # the centre of its box there, as it was measured


def _minus(one: Point, other: Point) -> Point:
    return one[0] - other[0], one[1] - other[1]


def _way(low: float, high: float, cut_low: bool, cut_high: bool) -> float:
    """Return how far an object has moved along an axis, given how far its edges have."""
    if cut_low and cut_high:
        return 0.0
    if cut_low or cut_high:
        return max(0.0, high if cut_low else -low)
    if low * high <= 0:
        return 0.0
    return min(abs(low + high) / 2, MOTION.slower * min(abs(low), abs(high)))
