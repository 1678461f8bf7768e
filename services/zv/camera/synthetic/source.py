"""The scene as a source of pictures, with faults on demand."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.messages import Track
from zv.camera.sources.base import TimedPicture
from zv.camera.synthetic.faults import Fault, fault_at
from zv.camera.synthetic.scene import Scene

LIGHTING_GAIN = 1.35  # as if another lamp were switched on
STALL_POLL_S = 0.05

Drawn = tuple[NDArray[np.uint8] | NDArray[np.uint16], tuple[Track, ...]]


@dataclass(frozen=True, slots=True)
class Conditions:
    """The parameters of the scene that may change from one picture to the next."""

    rate_hz: float = 30.0
    noise: float = 2.0  # of the sensor, grey levels
    objects: int = 4
    faults: tuple[Fault, ...] = ()  # where several overlap, each takes effect
    numbered: bool = False  # whether each picture shows its number (``frame_code``)
    depth: bool = False  # whether pictures are distances (16UC1) instead of colours (bgr8)


class SyntheticSource:
    """Pictures of a scene, frame after frame, with the faults that the conditions ask for.

    Frame k is due at k / rate. A stall blocks ``read`` for its duration, as a device would, and
    continues with the frame that is due then; a drop continues with that frame at once, unless
    the faults change before it is read. A frozen picture keeps its truth and its number. The
    number of a picture is its index among the delivered ones, which the camera counts as ``seq``.
    A change of the rate does not change the position and the speed of the objects.

    Args:
        size: Width and height, pixels.
        seed: Seed of the scene.
        conditions: Returns the current conditions; called before each picture and during stalls.
        stop: Ends stalls and reading when set; ``close`` sets it.
    """

    live = False

    def __init__(
        self,
        size: tuple[int, int],
        seed: int,
        conditions: Callable[[], Conditions],
        stop: threading.Event | None = None,
    ) -> None:
        self._size = size
        self._seed = seed
        self._current_conditions = conditions
        self._conditions = conditions()
        self._faults = tuple(fault.from_frame(0) for fault in self._conditions.faults)
        self._scene = self._make_scene()
        self.rate_hz: float | None = self._conditions.rate_hz
        self.description = (
            f"synthetic scene ({size[0]}x{size[1]}, {self._conditions.rate_hz:g} Hz, seed {seed})"
        )
        self._stop = threading.Event() if stop is None else stop
        self._k = 0  # the next frame
        self._undropped: int | None = None  # the first frame dropped since the last picture
        self._given = 0
        self._origin = (0, 0.0)  # a frame, and its time, from which the current rate counts
        self._frozen: tuple[Fault, Drawn] | None = None

    def next_due_s(self) -> float | None:
        """Return when the next picture is due; None once closed."""
        return self._time_s(self._k) if self._skip_to_picture() else None

    def read(self) -> TimedPicture | None:
        """Return the next picture; None once closed."""
        if not self._skip_to_picture():
            return None
        k, self._k, self._undropped = self._k, self._k + 1, None
        pixels, truth = self._drawn(k)
        self._given += 1
        encoding = "16UC1" if self._conditions.depth else "bgr8"
        return TimedPicture(PixelPicture(pixels, encoding), due_s=self._time_s(k), truth=truth)

    def close(self) -> None:
        """End a stall and all reading; safe to call twice and from any thread."""
        self._stop.set()

    def _skip_to_picture(self) -> bool:
        """Go through stalls and drops to the next frame with a picture; False if closed."""
        while not self._stop.is_set():
            self._update_conditions()
            gap = fault_at(self._faults, self._k, ("stall", "drop"))
            if gap is None:
                return True
            if gap.kind == "stall":
                self._stall(gap)
            else:
                self._undropped = self._k if self._undropped is None else self._undropped
                self._k = gap.end
        return False

    def _stall(self, stall: Fault) -> None:
        """Block for one frame of a stall, or until the stall is removed from the faults."""
        left = 1.0
        while left > 0 and stall in self._faults and not self._stop.is_set():
            rate_hz = self._conditions.rate_hz
            step_s = min(left / rate_hz, STALL_POLL_S)
            self._stop.wait(step_s)
            left -= step_s * rate_hz
            self._update_conditions()
        if left <= 0:
            self._k += 1

    def _update_conditions(self) -> None:
        """Apply the changes of the conditions since the last call."""
        before, now = self._conditions, self._current_conditions()
        if now.faults != before.faults:
            if self._undropped is not None:
                self._k, self._undropped = self._undropped, None
            self._faults = tuple(fault.from_frame(self._k) for fault in now.faults)
        if now.depth != before.depth:
            self._frozen = None
        if now.rate_hz != before.rate_hz:
            shown = max(0, self._k - 1)
            self._origin = (shown, self._time_s(shown))
            self.rate_hz = now.rate_hz
        self._conditions = now
        if (now.noise, now.objects) != (before.noise, before.objects):
            self._scene = self._make_scene()

    def _make_scene(self) -> Scene:
        now = self._conditions
        return Scene(*self._size, now.rate_hz, self._seed, now.noise, now.objects)

    def _time_s(self, k: int) -> float:
        """Return the time of frame k in the scene, at the current rate."""
        frame, time_s = self._origin
        return time_s + (k - frame) / self._conditions.rate_hz

    def _drawn(self, k: int) -> Drawn:
        """Return what the camera shows at frame k: an earlier frame if it is frozen."""
        frozen = fault_at(self._faults, k, ("frozen",))
        if frozen is None:
            self._frozen = None
        elif self._frozen is not None and self._frozen[0] == frozen:
            return self._frozen[1]
        drawn = self._scene_at(k)
        if frozen is not None:
            self._frozen = frozen, drawn
        return drawn

    def _scene_at(self, k: int) -> Drawn:
        if self._conditions.depth:
            return self._scene.depth(k, self._time_s(k))
        brighter = fault_at(self._faults, k, ("lighting",)) is not None
        number = self._given if self._conditions.numbered else None
        gain = LIGHTING_GAIN if brighter else 1.0
        return self._scene.frame(k, gain, self._time_s(k), number)
