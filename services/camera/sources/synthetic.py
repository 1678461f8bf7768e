"""The synthetic camera: a scene as a source, with faults on demand."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.messages import Track
from services.camera.scene.faults import Fault, fault_at
from services.camera.scene.scene import Scene
from services.camera.sources.base import Picture

LIGHTING_GAIN = 1.35  # as if another lamp went on


class SyntheticSource:
    """Pictures of a scene, frame after frame, with what is wrong with them on purpose.

    Frame k is due at k / rate. A stall blocks ``read`` for its duration as a device would, and
    then goes on with the frame that is due by then; a drop goes on there at once. A frozen
    picture comes with the truth of the moment it shows.

    Args:
        width: Pixels.
        height: Pixels.
        rate_hz: Frames per second.
        seed: Of the scene.
        noise: Sensor noise, grey levels.
        objects: How many things move.
        faults: What goes wrong; where several overlap, each has its effect.
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
        rate_hz: float,
        seed: int,
        noise: float,
        objects: int,
        faults: Sequence[Fault],
        max_frames: int | None = None,
        stop: threading.Event | None = None,
    ) -> None:
        self.description = f"synthetic scene ({width}x{height}, {rate_hz:g} Hz, seed {seed})"
        self.live = False
        self.rate_hz: float | None = rate_hz
        self._size = (width, height)
        self._period_s = 1.0 / rate_hz
        self._scene = Scene(width, height, rate_hz, seed, noise, objects)
        self._faults = tuple(faults)
        self._max_frames = max_frames
        self._stop = threading.Event() if stop is None else stop
        self._k = 0
        self._frozen: tuple[Fault, NDArray[np.uint8], tuple[Track, ...]] | None = None

    def read(self) -> Picture | None:
        """Return the next picture; None after ``max_frames`` or once closed."""
        while not self._ended():
            gap = fault_at(self._faults, self._k, ("stall", "drop"))
            if gap is None:
                return self._next()
            if gap.kind == "stall":
                self._stop.wait((gap.end - self._k) * self._period_s)
            self._k = gap.end
        return None

    def close(self) -> None:
        """End a stall and all reading; safe to call twice and from another thread."""
        self._stop.set()

    def _ended(self) -> bool:
        return self._stop.is_set() or (self._max_frames is not None and self._k >= self._max_frames)

    def _next(self) -> Picture:
        k, self._k = self._k, self._k + 1
        pixels, truth = self._view(k)
        return Picture(
            encoding="bgr8",
            width=self._size[0],
            height=self._size[1],
            pixels=pixels,
            due_s=k * self._period_s,
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
        return self._scene.frame(k, LIGHTING_GAIN if brighter else 1.0)
