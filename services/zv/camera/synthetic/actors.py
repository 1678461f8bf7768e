"""Makes the objects of a scene: derives kind, size, colours and path of each from the seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from zv.camera.synthetic.shapes import WIDTHS, Colors, Kind, draw
from zv.camera.synthetic.sprite import Point, Sprite, shadow
from zv.camera.synthetic.trajectory import Gait, Itinerary, Leg


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

# Main, second and accent colour; none is near the greys of the room.
WARDROBE: dict[Kind, tuple[Colors, ...]] = {
    "walker": (
        Colors((60, 50, 205), (110, 58, 30), (225, 225, 235)),
        Colors((170, 95, 20), (50, 46, 60), (70, 200, 240)),
        Colors((70, 130, 30), (90, 40, 70), (230, 230, 200)),
    ),
    "cart": (
        Colors((20, 120, 245), (90, 50, 20), (60, 40, 40)),
        Colors((160, 60, 130), (60, 30, 20), (240, 220, 90)),
        Colors((150, 150, 10), (60, 40, 30), (40, 60, 230)),
    ),
    "ball": (
        Colors((40, 40, 225), (210, 110, 20), (30, 200, 240)),
        Colors((70, 160, 20), (160, 40, 170), (20, 130, 250)),
        Colors((190, 60, 60), (40, 190, 240), (80, 40, 220)),
    ),
    "kite": (
        Colors((200, 130, 20), (140, 76, 8), (40, 210, 250)),
        Colors((60, 60, 220), (30, 30, 150), (230, 230, 230)),
        Colors((150, 40, 170), (95, 20, 110), (120, 240, 250)),
    ),
}


@dataclass(frozen=True, slots=True)
class Actor:
    """One object of the scene.

    Attributes:
        poses: Sprites of one cycle, facing right under 1 and left under -1; all of one size.
        shadow: On the ground; None for an object that flies.
    """

    id: int
    poses: dict[int, tuple[Sprite, ...]]
    shadow: Sprite | None
    itinerary: Itinerary


def make_actors(width: int, height: int, seed: int, objects: int) -> tuple[Actor, ...]:
    """Make the objects of a scene; a larger number adds objects without changing the others."""
    return tuple(_actor(index, width, height, seed) for index in range(objects))


def _actor(index: int, width: int, height: int, seed: int) -> Actor:
    rng = np.random.default_rng((seed, 2, index))
    role = ROLES[index % len(ROLES)]
    again = index // len(ROLES)  # later ones of a kind are smaller, elsewhere, at other times
    # In a narrow picture the objects shrink with the width.
    full = min(float(height), width * 0.75)
    size = max(3.0, role.size * full * 0.85**again)
    colors = WARDROBE[role.kind]
    grain = 1.0 + 0.045 * rng.standard_normal(
        (round(size) + 1, round(size * WIDTHS[role.kind]) + 2), np.float32
    )
    poses = draw(role.kind, size, colors[(seed + again) % len(colors)], grain)
    ground = role.gait != "sway"
    return Actor(
        id=index + 1,
        poses=poses,
        shadow=shadow(poses[1][0].mask.shape[1] * 1.05, size * 0.10 + 2) if ground else None,
        itinerary=_itinerary(role, again, poses[1][0].mask.shape[1], (width, height), full, rng),
    )


def _itinerary(
    role: Role,
    again: int,
    body: int,
    picture: tuple[int, int],
    full: float,
    rng: np.random.Generator,
) -> Itinerary:
    """Return a round: in from one side with a stop, out, back from the other with a stop, out.

    Args:
        role: Behaviour of its kind.
        again: Number of objects of this kind before it.
        body: Width of its sprites, pixels.
        picture: Width and height, pixels.
        full: Length of which the role's lengths are shares, pixels.
        rng: Decides positions and durations of the stops.
    """
    width, height = picture
    # Both ends are just outside, so that a visit begins with its first visible column.
    outside = (-body / 2, width + body / 2)
    if role.leftward != bool(again % 2):
        outside = outside[1], outside[0]
    lane = (role.lane - 0.05 * again) * height
    across = abs(outside[1] - outside[0])
    tempo = float(rng.uniform(0.94, 1.06))

    def walk(here: Point, there: Point) -> Leg:
        distance = abs(there[0] - here[0])
        cycles = max(1, round(distance / (role.stride * full)))
        return Leg(role.cross_s * tempo * distance / across, here, there, cycles)

    legs: list[Leg] = []
    for begin_x, end_x in (outside, outside[::-1]):
        stop = begin_x + (end_x - begin_x) * float(rng.uniform(0.36, 0.64))
        stop_y = lane + height * float(rng.uniform(-0.015, 0.015))
        begin, middle, end = (begin_x, lane), (stop, stop_y), (end_x, lane)

        legs += [
            walk(begin, middle),
            Leg(float(rng.uniform(*STAND_S)), middle, middle),
            walk(middle, end),
            Leg(role.away_s * tempo, end, end, away=True),
        ]
    period_s = sum(leg.duration_s for leg in legs)
    enters_s = role.enters_s + 3.7 * again + float(rng.uniform(0.0, 0.4))
    return Itinerary(legs, period_s - enters_s, role.gait, role.lift * full)
