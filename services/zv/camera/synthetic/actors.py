"""The objects of a scene: kind, size, colours and path of each derive from the seed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from zv.camera.synthetic.figures import WIDTHS, Kind, draw
from zv.camera.synthetic.sprite import Color, shadow

Gait = Literal["glide", "hop", "sway"]
"""It stays on the ground, bounces (parabolas), or swings up and down (a sine)."""


@dataclass(frozen=True, slots=True)
class Role:
    """The behaviour of a kind of object; lengths are shares of the height of a 4:3 picture."""

    kind: Kind
    size: float  # height
    lane: float  # y of its foot
    cross_s: float  # from one edge to the other
    away_s: float  # outside the picture, between two visits
    enters_s: float  # for the first time
    gait: Gait = "glide"
    lift: float = 0.0  # height of a hop or a swing
    stride: float = 0.4  # ground covered by one step, turn or hop
    leftward: bool = False  # whether it first enters from the right


# One is much larger than the others and seldom away, so that the largest moving object is clear.
# All rounds differ in length, so that the scene repeats itself only after a long time.
ROLES = (
    Role("walker", 0.56, 0.95, 6.0, 1.0, 0.3, stride=0.36),
    Role("cart", 0.19, 0.68, 4.4, 4.2, 2.6, stride=0.12, leftward=True),
    Role("ball", 0.12, 0.90, 3.6, 4.6, 5.2, gait="hop", lift=0.20, stride=0.27),
    Role("kite", 0.11, 0.30, 3.9, 3.9, 1.5, gait="sway", lift=0.07, stride=0.50, leftward=True),
)
STAND_S = (1.6, 2.4)

# Main, second and accent colour, RGB in hexadecimal; none is near the greys of the room.
WARDROBE: dict[Kind, str] = {
    "walker": "cd323c 1e3a6e ebe1e1 145faa 3c2e32 f0c846 1e8246 46285a c8e6e6",
    "cart": "f57814 14325a 28283c 823ca0 141e3c 5adcf0 0a9696 1e283c e63c28",
    "ball": "e12828 146ed2 f0c81e 14a046 aa28a0 fa8214 3c3cbe f0be28 dc2850",
    "kite": "1482c8 084c8c fad228 dc3c3c 961e1e e6e6e6 aa2896 6e145f faf078",
}


class Motion(NamedTuple):
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


class Leg(NamedTuple):
    """One straight part of a path, at constant speed; a stop if both ends are equal.

    It has a whole number of cycles, so that an object stops on the ground, its feet together.
    """

    duration_s: float
    begin: tuple[float, float]
    end: tuple[float, float]
    facing: int
    cycles: int = 0
    away: bool = False


class Actor:
    """One object of the scene, and its path in closed form.

    Attributes:
        poses: Sprites of one cycle, facing right under 1 and left under -1; all of one size.
        shadow: On the ground; None for an object that flies.
    """

    def __init__(self, index: int, width: int, height: int, seed: int) -> None:
        rng = np.random.default_rng((seed, 2, index))
        self.id = index + 1
        self._role = role = ROLES[index % len(ROLES)]
        again = index // len(ROLES)  # later ones of a kind are smaller, elsewhere, at other times
        # In a narrow picture the objects shrink with the width.
        full = min(float(height), width * 0.75)
        size = max(3.0, role.size * full * 0.85**again)
        texture = (round(size) + 1, round(size * WIDTHS[role.kind]) + 2)
        grain = 1.0 + 0.045 * rng.standard_normal(texture, np.float32)
        colors = [_bgr(text) for text in WARDROBE[role.kind].split()]
        first = 3 * ((seed + again) % (len(colors) // 3))
        main, second, accent = colors[first : first + 3]
        self.poses = draw(role.kind, size, (main, second, accent), grain)
        body = self.poses[1][0].mask.shape[1]
        self.shadow = None if role.gait == "sway" else shadow(body * 1.05, size * 0.10 + 2)

        # A round: in from one side with a stop, out, back from the other with a stop, out. Both
        # ends are just outside, so that a visit begins with its first visible column.
        left, right = -body / 2, width + body / 2
        tempo, lane = float(rng.uniform(0.94, 1.06)), (role.lane - 0.05 * again) * height
        self._legs: list[Leg] = []
        for facing in (1, -1) if role.leftward == bool(again % 2) else (-1, 1):
            begin_x, end_x = (left, right) if facing == 1 else (right, left)
            stop = begin_x + (end_x - begin_x) * float(rng.uniform(0.36, 0.64))
            stop_y = lane + height * float(rng.uniform(-0.015, 0.015))
            begin, middle, end = (begin_x, lane), (stop, stop_y), (end_x, lane)
            walks = []
            for one, other in ((begin, middle), (middle, end)):
                share = abs(other[0] - one[0]) / (right - left)
                cycles = max(1, round(share * (right - left) / (role.stride * full)))
                walks.append(Leg(role.cross_s * tempo * share, one, other, facing, cycles))
            stand = Leg(float(rng.uniform(*STAND_S)), middle, middle, facing)
            away = Leg(role.away_s * tempo, end, end, facing, away=True)
            self._legs += [walks[0], stand, walks[1], away]
        self._period_s = sum(leg.duration_s for leg in self._legs)
        enters_s = role.enters_s + 3.7 * again + float(rng.uniform(0.0, 0.4))
        self._offset_s = self._period_s - enters_s
        self._lift = role.lift * full

    def at(self, time_s: float) -> Motion | None:
        """Return its motion at a time in seconds, or None while it is away."""
        local_s = (time_s + self._offset_s) % self._period_s
        start_s = visit_s = 0.0
        for leg in self._legs:
            if local_s < start_s + leg.duration_s:
                break
            start_s += leg.duration_s
            if leg.away:
                visit_s = start_s
        if leg.away:
            return None
        done, span = (local_s - start_s) / leg.duration_s, leg.duration_s
        cycle = done * leg.cycles % 1.0
        height, slope = self._height(cycle)
        across, down = leg.end[0] - leg.begin[0], leg.end[1] - leg.begin[1]
        ground_y = leg.begin[1] + down * done
        return Motion(
            x=leg.begin[0] + across * done,
            y=ground_y - height,
            ground_y=ground_y,
            vx=across / span,
            vy=(down - slope * leg.cycles) / span,
            cycle=cycle,
            facing=leg.facing,
            age_s=local_s - visit_s,
        )

    def _height(self, cycle: float) -> tuple[float, float]:
        """Return the height above the ground, pixels, and its derivative by the cycle."""
        if self._role.gait == "hop":
            return 4.0 * self._lift * cycle * (1.0 - cycle), 4.0 * self._lift * (1.0 - 2.0 * cycle)
        if self._role.gait == "sway":
            turn = 2.0 * math.pi
            return self._lift * math.sin(turn * cycle), self._lift * turn * math.cos(turn * cycle)
        return 0.0, 0.0


def _bgr(text: str) -> Color:
    red, green, blue = bytes.fromhex(text)
    return blue, green, red
