"""Draws frame k of the scene, and returns the exact position of each object in it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.messages import Track
from zv.camera.synthetic import distances
from zv.camera.synthetic.actors import make_actors
from zv.camera.synthetic.backdrop import draw_room
from zv.camera.synthetic.frame_code import draw_number, extent
from zv.camera.synthetic.noise import SensorNoise
from zv.camera.synthetic.sprite import Sprite, overlap
from zv.camera.synthetic.trajectory import Motion

Pixels = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Placed:
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
        self._actors = make_actors(width, height, seed, objects)

    def background(self) -> Pixels:
        """Return the empty room without noise, (height, width, 3) uint8 BGR, a new array."""
        return self._room.copy()

    def frame(
        self, k: int, gain: float = 1.0, time_s: float | None = None, number: int | None = None
    ) -> tuple[Pixels, tuple[Track, ...]]:
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
        corner = (0, 0)
        if number is not None:
            draw_number(bgr, number)
            corner = extent(bgr.shape[1], bgr.shape[0])
        return bgr, self._truth(placed, corner)

    def depth(
        self, k: int, time_s: float | None = None
    ) -> tuple[NDArray[np.uint16], tuple[Track, ...]]:
        """Return the distances in frame k and its ground truth, as ``frame``.

        Returns:
            (height, width) uint16, millimetres, a new array; and the visible objects.
        """
        placed = self._placed(k, time_s)
        height, width = self._room.shape[:2]
        depth = distances.room_depth(width, height)
        for one in placed:
            millimetres = distances.object_depth(one.motion.ground_y, height)
            distances.paste(depth, one.sprite, one.left, one.top, millimetres)
        noise_mm = self._noise.signed(k) * np.float32(distances.MM_PER_LEVEL)
        noisy = np.rint(depth + noise_mm).astype(np.uint16)
        return noisy, self._truth(placed)

    def render(self, k: int) -> Pixels:
        """Return frame k, (height, width, 3) uint8 BGR, a new array."""
        return self.frame(k)[0]

    def truth(self, k: int) -> tuple[Track, ...]:
        """Return the ground truth of frame k without drawing it."""
        return self._truth(self._placed(k))

    def _placed(self, k: int, time_s: float | None = None) -> list[_Placed]:
        """Return the objects in frame k, farthest first."""
        time_s = k / self._rate_hz if time_s is None else time_s
        placed = []
        for actor in self._actors:
            motion = actor.itinerary.at(time_s)
            if motion is None:
                continue
            poses = actor.poses[motion.facing]
            sprite = poses[int(motion.cycle * len(poses))]
            height, width = sprite.mask.shape
            placed.append(
                _Placed(
                    id=actor.id,
                    sprite=sprite,
                    left=_nearest(motion.x - width / 2),
                    top=_nearest(motion.y - height),
                    motion=motion,
                    shadow=actor.shadow,
                )
            )
        # An object lower in the picture is nearer to the camera and hides the others.
        return sorted(placed, key=lambda one: (one.motion.ground_y, one.id))

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

    def _truth(self, placed: list[_Placed], corner: tuple[int, int] = (0, 0)) -> tuple[Track, ...]:
        """Return the visible part of each object; a corner of this width and height is hidden."""
        tracks = []
        for index, one in enumerate(placed):
            windows = overlap(self._room.shape, one.sprite.mask.shape, one.left, one.top)
            if windows is None:
                continue
            x0, y0 = windows[0][1].start, windows[0][0].start
            seen = one.sprite.mask[windows[1]]
            for nearer in placed[index + 1 :]:
                common = overlap(
                    seen.shape, nearer.sprite.mask.shape, nearer.left - x0, nearer.top - y0
                )
                if common is not None:
                    seen = seen.copy()
                    seen[common[0]] &= ~nearer.sprite.mask[common[1]]
            if x0 < corner[0] and y0 < corner[1]:
                seen = seen.copy()
                seen[: corner[1] - y0, : corner[0] - x0] = 0
            area = cv2.countNonZero(seen)
            if not area:
                continue
            x, y, width, height = cv2.boundingRect(seen)
            tracks.append(
                Track(
                    id=one.id,
                    state="confirmed",
                    x=float(x0 + x + int(width / 2)),
                    y=float(y0 + y + int(height / 2)),
                    box=(x0 + x, y0 + y, width, height),
                    area=float(area),
                    vx=one.motion.vx,
                    vy=one.motion.vy,
                    age_s=one.motion.age_s,
                )
            )
        return tuple(sorted(tracks, key=lambda track: track.id))


def _nearest(position: float) -> int:
    return int(np.floor(position + 0.5))
