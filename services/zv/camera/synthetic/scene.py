"""Draws frame k of the scene, and returns the exact position of each object in it."""

from __future__ import annotations

import math
from operator import attrgetter
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.messages import Track
from zv.camera.synthetic.actors import Actor, Motion
from zv.camera.synthetic.backdrop import WALL_FOOT, draw_room, floor_depth
from zv.camera.synthetic.frame_code import draw_number, extent
from zv.camera.synthetic.noise import SensorNoise
from zv.camera.synthetic.sprite import Sprite, overlap

NEAR_MM = 2000.0
"""Distance of the floor at the lower edge of the picture; the wall is then at about 5.6 m."""
BEFORE_WALL_MM = 300.0
"""Distance from the wall of the kite, which has no floor under it."""
MM_PER_LEVEL = 4.0
"""Deviation of a depth for each grey level of noise; 2 grey levels make 8 mm."""

Pixels = NDArray[np.uint8]
Truth = tuple[Track, ...]


class _Placed(NamedTuple):
    """An object in one frame: its sprite with the position of its top left corner."""

    id: int
    sprite: Sprite
    left: int
    top: int
    motion: Motion
    shadow: Sprite | None


class Scene:
    """A room with objects that move, cross, stand, leave and return.

    Frame k depends only on these arguments and on k; frames can be drawn in any order.

    Args:
        width: Pixels, at least 16.
        height: Pixels, at least 16.
        rate_hz: Frames per second of the scene's time.
        seed: Determines the room, the colours, the stops, the timing and the noise; 0 or more.
        noise: Standard deviation of the sensor noise, grey levels; 0 for none.
        objects: Number of moving objects; a larger number adds objects without changing others.
    """

    def __init__(
        self,
        width: int = 640,
        height: int = 480,
        rate_hz: float = 30.0,
        seed: int = 1,
        noise: float = 2.0,
        objects: int = 4,
    ) -> None:
        self._rate_hz = rate_hz
        # Separate random streams, so that another object does not change room and noise.
        self._room = draw_room(width, height, (seed, 0))
        self._noise = SensorNoise(width, height, noise, (seed, 1))
        self._actors = [Actor(index, width, height, seed) for index in range(objects)]

    def background(self) -> Pixels:
        """Return the empty room without noise, (height, width, 3) uint8 BGR, a new array."""
        return self._room.copy()

    def frame(
        self, k: int, gain: float = 1.0, time_s: float | None = None, number: int | None = None
    ) -> tuple[Pixels, Truth]:
        """Return frame k and its ground truth.

        Args:
            k: Number of the frame, from 0.
            gain: Brightness of the room; above 1 bright places saturate.
            time_s: Time in the scene; None for k / rate.
            number: Drawn over the corner after light and noise (``frame_code``); None for none.

        Returns:
            (height, width, 3) uint8 BGR, a new array; and, in the order of their ids, the
            objects with at least one visible pixel: box and area of the visible pixels.
        """
        placed = self._placed(k, time_s)
        bgr = self._painted(placed)
        if gain != 1.0:
            cv2.convertScaleAbs(bgr, dst=bgr, alpha=gain)
        self._noise.add(k, bgr)
        if number is None:
            return bgr, self._truth(placed)
        draw_number(bgr, number)
        return bgr, self._truth(placed, extent(bgr.shape[1], bgr.shape[0]))

    def depth(self, k: int, time_s: float | None = None) -> tuple[NDArray[np.uint16], Truth]:
        """Return the distances in frame k and its ground truth, as ``frame``.

        Returns:
            (height, width) uint16, millimetres, a new array; and the visible objects.
        """
        placed = self._placed(k, time_s)
        height, width = self._room.shape[:2]
        rows = [self._distance_mm(max(row, round(height * WALL_FOOT))) for row in range(height)]
        depth = np.repeat(np.rint(rows)[:, None], width, axis=1)
        for one in placed:
            windows = overlap(depth.shape, one.sprite.mask.shape, one.left, one.top)
            if windows is not None:
                seen = one.sprite.mask[windows[1]] > 0
                depth[windows[0]][seen] = round(self._distance_mm(one.motion.ground_y))
        depth += self._noise.signed(k) * MM_PER_LEVEL
        return np.rint(depth).astype(np.uint16), self._truth(placed)

    def render(self, k: int) -> Pixels:
        """Return frame k, (height, width, 3) uint8 BGR, a new array."""
        return self.frame(k)[0]

    def truth(self, k: int) -> Truth:
        """Return the ground truth of frame k without drawing it."""
        return self._truth(self._placed(k))

    def _distance_mm(self, row: float) -> float:
        """Return how far away something is that stands on a row of the picture."""
        height: int = self._room.shape[0]
        foot = round(height * WALL_FOOT)
        if row < foot:
            return float(NEAR_MM * floor_depth(float(foot), height)) - BEFORE_WALL_MM
        return float(NEAR_MM * floor_depth(row, height))

    def _placed(self, k: int, time_s: float | None = None) -> list[_Placed]:
        """Return the objects in frame k, farthest first."""
        placed = []
        for actor in self._actors:
            motion = actor.at(k / self._rate_hz if time_s is None else time_s)
            if motion is None:
                continue
            poses = actor.poses[motion.facing]
            sprite = poses[int(motion.cycle * len(poses))]
            height, width = sprite.mask.shape
            left, top = _nearest(motion.x - width / 2), _nearest(motion.y - height)
            placed.append(_Placed(actor.id, sprite, left, top, motion, actor.shadow))
        # An object lower in the picture is nearer to the camera and hides the others.
        return sorted(placed, key=attrgetter("motion.ground_y", "id"))

    def _painted(self, placed: list[_Placed]) -> Pixels:
        """Return the room with shadows and objects, before the sensor noise."""
        bgr = self._room.copy()
        for one in placed:
            if one.shadow is not None:
                height, width = one.shadow.mask.shape
                left = _nearest(one.motion.x - width / 2)
                one.shadow.paste(bgr, left, _nearest(one.motion.ground_y - height * 0.6))
        for one in placed:
            one.sprite.paste(bgr, one.left, one.top)
        return bgr

    def _truth(self, placed: list[_Placed], corner: tuple[int, int] = (0, 0)) -> Truth:
        """Return the visible part of each object; a corner of this width and height is hidden."""
        tracks = []
        for number, one in enumerate(placed, 1):
            windows = overlap(self._room.shape, one.sprite.mask.shape, one.left, one.top)
            if windows is None:
                continue
            (rows, columns), here = windows
            left, top = columns.start, rows.start
            seen = one.sprite.mask[here].copy()
            seen[: max(0, corner[1] - top), : max(0, corner[0] - left)] = 0
            for nearer in placed[number:]:
                mask = nearer.sprite.mask
                both = overlap(seen.shape, mask.shape, nearer.left - left, nearer.top - top)
                if both is not None:
                    seen[both[0]] &= ~mask[both[1]]
            if not (area := cv2.countNonZero(seen)):
                continue
            x, y, width, height = cv2.boundingRect(seen)
            x, y = x + left, y + top
            tracks.append(
                Track(
                    id=one.id,
                    state="confirmed",
                    x=float(x + int(width / 2)),
                    y=float(y + int(height / 2)),
                    box=(x, y, width, height),
                    area=float(area),
                    vx=one.motion.vx,
                    vy=one.motion.vy,
                    age_s=one.motion.age_s,
                )
            )
        return tuple(sorted(tracks, key=attrgetter("id")))


def _nearest(position: float) -> int:
    return math.floor(position + 0.5)
