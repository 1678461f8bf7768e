"""The whole scene: the picture of frame k, and where everything in it is, to the pixel."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from common.messages import Track
from services.camera.scene.backdrop import draw_room
from services.camera.scene.cast import Actor, cast
from services.camera.scene.itinerary import Motion
from services.camera.scene.noise import SensorNoise
from services.camera.scene.numbering import draw_number, extent
from services.camera.scene.sprite import Sprite, overlap

MIN_SIDE = 16

Pixels = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Placed:
    """An object in one frame: its sprite with the top left corner's place in the picture."""

    id: int
    sprite: Sprite
    left: int
    top: int
    motion: Motion
    shadow: Sprite | None


class Scene:
    """A room with things that move in it, cross, stand, leave and return.

    Frame k depends on these arguments and k alone: in any order, in any process.

    Args:
        width: Pixels, at least 16.
        height: Pixels, at least 16.
        rate_hz: Frames per second of the scene's time.
        seed: Decides the room, the colours, the stops, the timing and the noise; 0 or more.
        noise: Standard deviation of the sensor noise, grey levels; 0 for none.
        objects: How many things move; the first few are the same however many there are.

    Raises:
        ValueError: If an argument is outside its range.
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
        if min(width, height) < MIN_SIDE:
            raise ValueError(f"a scene of {width}x{height}: at least {MIN_SIDE}x{MIN_SIDE}")
        if not rate_hz > 0:
            raise ValueError(f"rate_hz is {rate_hz}: must be above 0")
        if seed < 0 or noise < 0 or objects < 0:
            raise ValueError(
                f"seed {seed}, noise {noise} and objects {objects}: none may be negative"
            )
        self._rate_hz = rate_hz
        # Streams of their own, so that one more object leaves the room and the noise as they are.
        self._room = draw_room(width, height, (seed, 0))
        self._noise = SensorNoise(width, height, noise, (seed, 1))
        self._actors: tuple[Actor, ...] = cast(width, height, seed, objects)

    def background(self) -> Pixels:
        """Return the empty room without noise, (height, width, 3) uint8 BGR, a new array."""
        return self._room.copy()

    def frame(
        self, k: int, gain: float = 1.0, time_s: float | None = None, number: int | None = None
    ) -> tuple[Pixels, tuple[Track, ...]]:
        """Return frame k and the truth about it.

        Args:
            k: Number of the frame, from 0.
            gain: Of the light in the room; above 1 bright places saturate.
            time_s: When in the scene's time it is; None for k / rate.
            number: Drawn over the corner, free of light and noise (``numbering``); None: none.

        Returns:
            (height, width, 3) uint8 BGR, a new array; and each object of which at least one pixel
            can be seen, in the order of the ids: the box and the area of its visible pixels.
        """
        placed = self._placed(k, time_s)
        bgr = self._painted(placed)
        if gain != 1.0:
            cv2.convertScaleAbs(bgr, dst=bgr, alpha=gain)
        self._noise.add(k, bgr)
        if number is None:
            return bgr, self._truth(placed)
        draw_number(bgr, number)
        height, width = bgr.shape[:2]
        return bgr, self._truth(placed, extent(width, height))

    def render(self, k: int) -> Pixels:
        """Return frame k, (height, width, 3) uint8 BGR, a new array."""
        return self.frame(k)[0]

    def truth(self, k: int) -> tuple[Track, ...]:
        """Return where everything is in frame k, without painting it."""
        return self._truth(self._placed(k))

    def painted(self, k: int, without: Collection[int] = ()) -> Pixels:
        """Return frame k before the sensor noise.

        Args:
            k: Number of the frame, from 0.
            without: Ids of objects to leave out; their shadows on the ground stay, so that the
                difference to the whole picture is what these objects add to it.

        Returns:
            (height, width, 3) uint8 BGR, a new array.
        """
        return self._painted(self._placed(k), without)

    def _placed(self, k: int, time_s: float | None = None) -> list[_Placed]:
        """Return the objects that are on their way through frame k, farthest first."""
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
        # Who stands lower in the picture is nearer to the camera and hides the others.
        return sorted(placed, key=lambda one: (one.motion.ground_y, one.id))

    def _painted(self, placed: list[_Placed], without: Collection[int] = ()) -> Pixels:
        bgr = self._room.copy()
        for one in placed:
            if one.shadow is not None:
                height, width = one.shadow.mask.shape
                left = _nearest(one.motion.x - width / 2)
                one.shadow.paste(bgr, left, _nearest(one.motion.ground_y - height * 0.6))
        for one in placed:
            if one.id not in without:
                one.sprite.paste(bgr, one.left, one.top)
        return bgr

    def _truth(self, placed: list[_Placed], corner: tuple[int, int] = (0, 0)) -> tuple[Track, ...]:
        """Return what can be seen of each object; nothing in a corner of so many pixels."""
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
