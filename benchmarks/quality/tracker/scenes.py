"""Scenes with exact truth: textured objects before a textured wall, the same ones each time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.tracker.sequence import START_NS, Box, Shot, Shots
from zv.camera.synthetic.noise import SensorNoise

WIDTH, HEIGHT = 640, 480
LEAST_VISIBLE = 0.5
"""Objects of which less is visible, behind others or outside the picture, are ignored."""

Waypoint = tuple[float, float, float]
"""Time in s, x and y of the foot in pixels; between two of them the object moves steadily."""


@dataclass(frozen=True)
class Actor:
    """An object that is in the scene from its first to its last waypoint.

    Attributes:
        id: Id in the truth; the same for all visits.
        visits: The waypoints of each visit.
        size: Width and height, pixels.
        colours: BGR of its upper and lower half.
        shadow: x and y of the shadow's tip from the foot, pixels, or None.
    """

    id: int
    visits: tuple[tuple[Waypoint, ...], ...]
    size: tuple[int, int] = (34, 86)
    colours: tuple[tuple[int, int, int], tuple[int, int, int]] = ((60, 50, 150), (90, 60, 40))
    shadow: tuple[int, int] | None = None

    def foot(self, time_s: float) -> tuple[float, float] | None:
        """Return x and y of its foot, or None between its visits."""
        for visit in self.visits:
            times = [point[0] for point in visit]
            if times[0] <= time_s <= times[-1]:
                x = float(np.interp(time_s, times, [point[1] for point in visit]))
                y = float(np.interp(time_s, times, [point[2] for point in visit]))
                return x, y
        return None

    def box(self, time_s: float) -> Box | None:
        """Return its whole box, also outside the picture and behind others."""
        foot = self.foot(time_s)
        if foot is None:
            return None
        width, height = self.size
        return (foot[0] - width / 2, foot[1] - height, width, height)


@dataclass(frozen=True)
class Scene:
    """Actors in a scene, nearer ones (with a lower foot) before others.

    Attributes:
        name: Name in the table.
        duration_s: Duration; the actors' times are within it.
        actors: The actors, in any order.
        light: Gain of the whole picture at a time.
        noise: Standard deviation of the sensor's noise, grey levels.
        pillar: x, y, width, height of a pillar that hides all actors, or None.
        seed: Seed of the textures.
    """

    name: str
    duration_s: float
    actors: tuple[Actor, ...]
    light: Callable[[float], float] = lambda _: 1.0
    noise: float = 2.0
    pillar: tuple[int, int, int, int] | None = None
    seed: int = 1

    def shots(self, rate_hz: float) -> Shots:
        """Return the sequence of its pictures at a rate."""

        def drawn() -> Iterator[Shot]:
            noise = SensorNoise(WIDTH, HEIGHT, self.noise, (self.seed, 9))
            for index in range(int(self.duration_s * rate_hz)):
                time_s = index / rate_hz
                bgr = self.picture(time_s)
                noise.add(index, bgr)
                truth, ignored = self.truth(time_s)
                yield Shot(index, bgr, START_NS + round(time_s * 1e9), truth, ignored)

        return drawn

    def picture(self, time_s: float) -> NDArray[np.uint8]:
        """Return the picture at a time without noise, (HEIGHT, WIDTH, 3) uint8, a new array."""
        bgr = self.backdrop(time_s)
        present = self._present(time_s)
        for actor, box in present:
            if actor.shadow is not None:
                _darken(bgr, actor, box)
        for actor, box in present:
            self._paste(bgr, actor, box)
        if self.pillar is not None:
            x, y, width, height = self.pillar
            bgr[y : y + height, x : x + width] = self._column
        gain = self.light(time_s)
        return bgr if gain == 1.0 else cv2.convertScaleAbs(bgr, alpha=gain)  # type: ignore[return-value]

    def backdrop(self, _: float) -> NDArray[np.uint8]:
        """Return the scene without actors at a time, a new array."""
        return self._wall.copy()

    def truth(self, time_s: float) -> tuple[dict[int, Box], list[Box]]:
        """Return the boxes by id at a time, cut at the border; and those of hidden objects."""
        present = self._present(time_s)
        hiding: list[Box] = [] if self.pillar is None else [self.pillar]
        truth: dict[int, Box] = {}
        ignored: list[Box] = []
        for actor, box in reversed(present):  # the nearest first
            inside = cut(box)
            if inside is not None:
                if visible(box, inside, hiding) < LEAST_VISIBLE:
                    ignored.append(inside)
                else:
                    truth[actor.id] = inside
            hiding.append(box)
        return truth, ignored

    def _present(self, time_s: float) -> list[tuple[Actor, Box]]:
        there = [(actor, actor.box(time_s)) for actor in self.actors]
        shown = [(actor, box) for actor, box in there if box is not None]
        return sorted(shown, key=lambda one: (one[1][1] + one[1][3], one[0].id))

    @cached_property
    def _wall(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng((self.seed, 0))
        grey = np.full((HEIGHT, WIDTH), 118.0, np.float32)
        for grain, sigma in ((80, 12.0), (16, 8.0), (4, 5.0), (1, 3.0)):
            grey += sigma * _blotches(rng, WIDTH, HEIGHT, grain)
        tint = np.array([0.96, 1.0, 1.03], np.float32)
        return np.clip(grey[:, :, None] * tint, 0, 255).astype(np.uint8)

    @cached_property
    def _column(self) -> NDArray[np.uint8]:
        assert self.pillar is not None
        rng = np.random.default_rng((self.seed, 1))
        grey = 150 + 8 * _blotches(rng, self.pillar[2], self.pillar[3], 6)
        return np.clip(grey[:, :, None] * np.ones(3), 0, 255).astype(np.uint8)

    @cached_property
    def _sprites(self) -> dict[int, tuple[NDArray[np.float32], NDArray[np.float32]]]:
        """Return colour and share of each actor's pixels, with a rim of one pixel."""
        sprites = {}
        for actor in self.actors:
            width, height = actor.size
            rng = np.random.default_rng((self.seed, 2, actor.id))
            upper = (np.arange(height + 2) < height * 0.55)[:, None, None]
            colour = np.where(upper, *(np.array(one, np.float32) for one in actor.colours))
            surface = colour + 10 * _blotches(rng, width + 2, height + 2, 5)[:, :, None]
            sprites[actor.id] = (np.clip(surface, 0, 255).astype(np.float32), _shape(width, height))
        return sprites

    def _paste(self, bgr: NDArray[np.uint8], actor: Actor, box: Box) -> None:
        surface, share = self._sprites[actor.id]
        left, top = int(np.floor(box[0])), int(np.floor(box[1]))
        shift = np.array([[1, 0, box[0] - left], [0, 1, box[1] - top]])
        rows, columns = share.shape[:2]
        size = (columns, rows)
        moved = np.asarray(cv2.warpAffine(share, shift, size), np.float32)[:, :, None]
        _blend(bgr, left - 1, top - 1, surface, moved)


def cut(box: Box) -> Box | None:
    """Return the part of a box inside the picture, or None if there is none."""
    x0, y0 = max(box[0], 0.0), max(box[1], 0.0)
    x1, y1 = min(box[0] + box[2], WIDTH), min(box[1] + box[3], HEIGHT)
    return (x0, y0, x1 - x0, y1 - y0) if x1 > x0 and y1 > y0 else None


def visible(box: Box, inside: Box, hiding: list[Box]) -> float:
    """Return the share of a box that is inside the picture and not behind others, by pixels."""
    seen = np.ones((round(inside[3]) or 1, round(inside[2]) or 1), bool)
    for other in hiding:
        x0, y0 = round(other[0] - inside[0]), round(other[1] - inside[1])
        x1, y1 = round(x0 + other[2]), round(y0 + other[3])
        seen[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = False
    return float(seen.mean()) * inside[2] * inside[3] / (box[2] * box[3])


def _blotches(rng: np.random.Generator, width: int, height: int, grain: int) -> NDArray[np.float32]:
    coarse = rng.standard_normal((-(-height // grain) + 1, -(-width // grain) + 1), np.float32)
    if grain == 1:
        return coarse[:height, :width]
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))


def _shape(width: int, height: int) -> NDArray[np.float32]:
    """Return the share of each pixel in a head on a rounded body, with a rim of one pixel."""
    scale = 8
    large = np.zeros(((height + 2) * scale, (width + 2) * scale), np.uint8)
    w, h = width * scale, height * scale
    middle = (scale + w // 2, scale)
    head = (round(w * 0.28), round(h * 0.09))
    cv2.ellipse(large, (middle[0], middle[1] + head[1]), head, 0, 0, 360, 255, -1)
    shoulder, radius = scale + round(h * 0.15), w // 4
    cv2.rectangle(large, (scale, shoulder + radius), (scale + w - 1, scale + h - 1), 255, -1)
    cv2.rectangle(large, (scale + radius, shoulder), (scale + w - radius, scale + h // 2), 255, -1)
    for x in (scale + radius, scale + w - radius):
        cv2.circle(large, (x, shoulder + radius), radius, 255, -1)
    small = cv2.resize(large, (width + 2, height + 2), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32) / 255


def _darken(bgr: NDArray[np.uint8], actor: Actor, box: Box) -> None:
    """Put the actor's shadow on the ground: an ellipse from its foot, 0.6 as bright."""
    assert actor.shadow is not None
    dx, dy = actor.shadow
    foot = (box[0] + box[2] / 2, box[1] + box[3] - 3)
    length, width = float(np.hypot(dx, dy)) / 2, box[2] * 0.42
    mask = np.zeros(bgr.shape[:2], np.uint8)
    centre = (round(foot[0] + dx / 2), round(foot[1] + dy / 2))
    axes = (round(length), round(width))
    cv2.ellipse(mask, centre, axes, float(np.degrees(np.arctan2(dy, dx))), 0, 360, 255, -1)
    x, y, columns, rows = cv2.boundingRect(mask)
    window = np.s_[max(y - 4, 0) : y + rows + 4, max(x - 4, 0) : x + columns + 4]
    share = cv2.GaussianBlur(mask[window], (0, 0), 1.5).astype(np.float32) / 255
    bgr[window] = np.rint(bgr[window] * (1 - 0.4 * share[:, :, None])).astype(np.uint8)


def _blend(
    bgr: NDArray[np.uint8],
    left: int,
    top: int,
    surface: NDArray[np.float32],
    share: NDArray[np.float32],
) -> None:
    rows, columns = share.shape[:2]
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + columns, bgr.shape[1]), min(top + rows, bgr.shape[0])
    if x0 >= x1 or y0 >= y1:
        return
    part = np.s_[y0 - top : y1 - top, x0 - left : x1 - left]
    under = bgr[y0:y1, x0:x1]
    under[:] = np.rint(under * (1 - share[part]) + surface[part] * share[part]).astype(np.uint8)
