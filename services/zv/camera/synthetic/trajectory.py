"""Computes an object's path in closed form: position and velocity at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal

Gait = Literal["glide", "hop", "sway"]


@dataclass(frozen=True, slots=True)
class Leg:
    """One straight part of a path, at constant speed; a stop if both ends are equal.

    Attributes:
        begin: x, y on the ground, pixels.
        end: As ``begin``.
        cycles: Steps, turns or hops during the leg: a whole number, so that an object stops on
            the ground and with its feet together.
        away: Whether the object is outside of the picture.
    """

    duration_s: float
    begin: tuple[float, float]
    end: tuple[float, float]
    cycles: int = 0
    away: bool = False


@dataclass(frozen=True, slots=True)
class Motion:
    """Position, in pixels, and velocity, in pixels per second, of an object at one time.

    Attributes:
        x: Middle of its foot.
        y: Its foot; less than ``ground_y`` when in the air.
        ground_y: The ground under it.
        cycle: Fraction of the current step, turn or hop, in [0, 1).
        facing: 1 to the right, -1 to the left.
        age_s: Seconds since it entered the picture.
    """

    x: float
    y: float
    ground_y: float
    vx: float
    vy: float
    cycle: float
    facing: int
    age_s: float


class Itinerary:
    """A sequence of legs, repeated forever.

    Args:
        legs: At least one; each begins where the one before ended, except after one away.
        offset_s: Position of time 0 within the first round, seconds.
        gait: ``glide`` stays on the ground, ``hop`` bounces (parabolas), ``sway`` swings
            up and down (a sine).
        lift: Height of a hop or a swing, pixels.
    """

    def __init__(self, legs: Sequence[Leg], offset_s: float, gait: Gait, lift: float) -> None:
        self._legs = tuple(legs)
        *_, self._period_s = accumulate(leg.duration_s for leg in legs)
        self._offset_s = offset_s
        self._gait = gait
        self._lift = lift

    def at(self, time_s: float) -> Motion | None:
        """Return the motion at a time in seconds, or None while away."""
        local_s = (time_s + self._offset_s) % self._period_s
        start_s = visit_s = 0.0
        facing = 1
        for leg in self._legs:
            if leg.end[0] != leg.begin[0]:
                facing = 1 if leg.end[0] > leg.begin[0] else -1
            if local_s < start_s + leg.duration_s:
                break
            start_s += leg.duration_s
            if leg.away:
                visit_s = start_s
        if leg.away:
            return None
        done = (local_s - start_s) / leg.duration_s
        cycles = done * leg.cycles
        height, slope = self._height(cycles % 1.0)
        ground_y = leg.begin[1] + (leg.end[1] - leg.begin[1]) * done
        return Motion(
            x=leg.begin[0] + (leg.end[0] - leg.begin[0]) * done,
            y=ground_y - height,
            ground_y=ground_y,
            vx=(leg.end[0] - leg.begin[0]) / leg.duration_s,
            vy=(leg.end[1] - leg.begin[1] - slope * leg.cycles) / leg.duration_s,
            cycle=cycles % 1.0,
            facing=facing,
            age_s=local_s - visit_s,
        )

    def _height(self, cycle: float) -> tuple[float, float]:
        """Return the height above the ground, pixels, and its derivative by the cycle."""
        if self._gait == "hop":
            return 4.0 * self._lift * cycle * (1.0 - cycle), 4.0 * self._lift * (1.0 - 2.0 * cycle)
        if self._gait == "sway":
            turn = 2.0 * math.pi
            return self._lift * math.sin(turn * cycle), self._lift * turn * math.cos(turn * cycle)
        return 0.0, 0.0
