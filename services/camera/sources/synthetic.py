"""The synthetic camera: a scene as a source, with faults on demand."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.messages import Track
from services.camera.scene.faults import Fault, fault_at
from services.camera.scene.scene import Scene
from services.camera.sources.base import Picture

LIGHTING_GAIN = 1.35  # as if another lamp went on
STALL_POLL_S = 0.05


@dataclass(frozen=True, slots=True)
class Conditions:
    """What may change from one picture to the next.

    Attributes:
        rate_hz: Frames per second.
        noise: Sensor noise, grey levels.
        objects: How many things move.
        faults: What goes wrong; where several overlap, each has its effect.
        numbered: Whether each picture shows its number.
    """

    rate_hz: float = 30.0
    noise: float = 2.0
    objects: int = 4
    faults: tuple[Fault, ...] = ()
    numbered: bool = False


class SyntheticSource:
    """Pictures of a scene, frame after frame, with what is wrong with them on purpose.

    Frame k is due at k / rate. A stall blocks ``read`` for its duration as a device would, and
    then goes on with the frame that is due by then; a drop goes on there at once. A frozen
    picture comes with the truth of the moment it shows, and with its number. The number of a
    picture is how many this source gave before it: what the camera counts as ``seq``. At another
    rate the scene goes on from where it is, at its own speed.

    Args:
        width: Pixels.
        height: Pixels.
        seed: Of the scene.
        conditions: Asked before each picture, and again and again during a stall.
        max_frames: Frames of the scene until the regular end, skipped ones included; None: no end.
        stop: Ends a stall when set; ``close`` sets it.

    Raises:
        ValueError: If the scene cannot be made like that.
    """

    def __init__(
        self,
        *,
        width: int,
        height: int,
        seed: int,
        conditions: Callable[[], Conditions],
        max_frames: int | None = None,
        stop: threading.Event | None = None,
    ) -> None:
        self._size = (width, height)
        self._seed = seed
        self._ask = conditions
        self._conditions = conditions()
        self._faults = tuple(fault.from_frame(0) for fault in self._conditions.faults)
        self._scene = self._made_scene()
        self.live = False
        self.rate_hz: float | None = self._conditions.rate_hz
        self.description = (
            f"synthetic scene ({width}x{height}, {self._conditions.rate_hz:g} Hz, seed {seed})"
        )
        self._max_frames = max_frames
        self._stop = threading.Event() if stop is None else stop
        self._k = 0
        self._given = 0
        self._origin = (0, 0.0)  # a frame at the rate of now, and its time
        self._frozen: tuple[Fault, NDArray[np.uint8], tuple[Track, ...]] | None = None

    def next_due_s(self) -> float | None:
        """Return when the next picture is due; None after ``max_frames`` or once closed."""
        return self._time_s(self._k) if self._reaches_a_picture() else None

    def read(self) -> Picture | None:
        """Return the next picture; None after ``max_frames`` or once closed."""
        return self._next() if self._reaches_a_picture() else None

    def close(self) -> None:
        """End a stall and all reading; safe to call twice and from another thread."""
        self._stop.set()

    def _ended(self) -> bool:
        return self._stop.is_set() or (self._max_frames is not None and self._k >= self._max_frames)

    def _reaches_a_picture(self) -> bool:
        """Go through stalls and drops to the next frame with a picture; tell if there is one."""
        while not self._ended():
            self._look_around()
            gap = fault_at(self._faults, self._k, ("stall", "drop"))
            if gap is None:
                return True
            if gap.kind == "stall":
                self._stall(gap)
            else:
                self._k = gap.end
        return False

    def _stall(self, stall: Fault) -> None:
        """Block for one frame of a stall, or until it is none of the faults any more."""
        left = 1.0
        while left > 0 and stall in self._faults and not self._stop.is_set():
            rate_hz = self._conditions.rate_hz
            step_s = min(left / rate_hz, STALL_POLL_S)
            self._stop.wait(step_s)
            left -= step_s * rate_hz
            self._look_around()
        if left <= 0:
            self._k += 1

    def _look_around(self) -> None:
        """Take over conditions that have changed."""
        before, now = self._conditions, self._ask()
        if now.faults != before.faults:
            self._faults = tuple(fault.from_frame(self._k) for fault in now.faults)
        if now.rate_hz != before.rate_hz:
            shown = max(0, self._k - 1)
            self._origin = (shown, self._time_s(shown))
            self.rate_hz = now.rate_hz
        self._conditions = now
        if (now.noise, now.objects) != (before.noise, before.objects):
            self._scene = self._made_scene()

    def _made_scene(self) -> Scene:
        now = self._conditions
        return Scene(*self._size, now.rate_hz, self._seed, now.noise, now.objects)

    def _time_s(self, k: int) -> float:
        """Return when in the scene's time frame k is, at the rate of now."""
        frame, time_s = self._origin
        return time_s + (k - frame) / self._conditions.rate_hz

    def _next(self) -> Picture:
        k, self._k = self._k, self._k + 1
        pixels, truth = self._view(k)
        self._given += 1
        return Picture(
            encoding="bgr8",
            width=self._size[0],
            height=self._size[1],
            pixels=pixels,
            due_s=self._time_s(k),
            truth=truth,
        )

    def _view(self, k: int) -> tuple[NDArray[np.uint8], tuple[Track, ...]]:
        """Return what the camera shows at frame k, which need not be frame k."""
        frozen = fault_at(self._faults, k, ("frozen",))
        if frozen is None:
            self._frozen = None
            return self._light(k)
        if self._frozen is None or self._frozen[0] != frozen:
            self._frozen = (frozen, *self._light(k))
        _, pixels, truth = self._frozen
        return pixels.copy(), truth  # whoever holds the one picture may not change the next

    def _light(self, k: int) -> tuple[NDArray[np.uint8], tuple[Track, ...]]:
        brighter = fault_at(self._faults, k, ("lighting",)) is not None
        number = self._given if self._conditions.numbered else None
        return self._scene.frame(k, LIGHTING_GAIN if brighter else 1.0, self._time_s(k), number)
