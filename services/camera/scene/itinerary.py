"""A way through the picture in closed form: time in, position and velocity out."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Gait = Literal["glide", "hop", "sway"]


@dataclass(frozen=True, slots=True)
class Leg:
    """One straight piece of a way, at constant speed; standing still if both ends are equal.

    Attributes:
        duration_s: Seconds, above 0.
        begin: x, y on the ground, pixels.
        end: x, y on the ground, pixels.
        cycles: Steps, turns or hops during the leg: a whole number, so that whoever stops
            does so on the ground and with its feet together.
        away: True while the object is outside the picture.
    """

    duration_s: float
    begin: tuple[float, float]
    end: tuple[float, float]
    cycles: int = 0
    away: bool = False


@dataclass(frozen=True, slots=True)
class Motion:
    """Where an object is at one time, and how it moves.

    Attributes:
        x: Middle of its foot, pixels.
        y: Its foot, pixels; less than ``ground_y`` when in the air.
        ground_y: The spot on the ground under it, pixels.
        vx: Pixels per second.
        vy: Pixels per second.
        cycle: Fraction of the current step, turn or hop, in [0, 1).
        facing: 1 to the right, -1 to the left.
        age_s: Seconds since it set off from the edge into the picture.
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
    """Legs that are walked one after the other, for ever.

    Args:
        legs: At least one; each begins where the one before ended, save after one away.
        offset_s: Time within the first round at which time 0 falls.
        gait: ``glide`` stays on the ground, ``hop`` bounces (parabolas), ``sway`` swings
            up and down (a sine).
        lift: Height of a hop or a swing, pixels.
    """

    def __init__(
        self, legs: Sequence[Leg], offset_s: float = 0.0, gait: Gait = "glide", lift: float = 0.0
    ) -> None:
        self._legs = tuple(legs)
        self._offset_s = offset_s
        self._gait = gait
        self._lift = lift
        self._starts_s: list[float] = []
        self._visits_s: list[float] = []
        self._facings: list[int] = []
        now_s = visit_s = 0.0
        facing = 1
        for leg in self._legs:
            if leg.away:
                visit_s = now_s + leg.duration_s
            if leg.end[0] != leg.begin[0]:
                facing = 1 if leg.end[0] > leg.begin[0] else -1
            self._starts_s.append(now_s)
            self._visits_s.append(visit_s)
            self._facings.append(facing)
            now_s += leg.duration_s
        self.period_s = now_s

    def at(self, time_s: float) -> Motion | None:
        """Return the motion at a time in seconds, or None while away."""
        local_s = (time_s + self._offset_s) % self.period_s
        index = bisect_right(self._starts_s, local_s) - 1
        leg = self._legs[index]
        if leg.away:
            return None
        done = (local_s - self._starts_s[index]) / leg.duration_s
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
            facing=self._facings[index],
            age_s=local_s - self._visits_s[index],
        )

    def _height(self, cycle: float) -> tuple[float, float]:
        """Return the height above the ground, pixels, and its derivative by the cycle."""
        if self._gait == "hop":
            return 4.0 * self._lift * cycle * (1.0 - cycle), 4.0 * self._lift * (1.0 - 2.0 * cycle)
        if self._gait == "sway":
            turn = 2.0 * math.pi
            return self._lift * math.sin(turn * cycle), self._lift * turn * math.cos(turn * cycle)
        return 0.0, 0.0
