"""When each moment of a recording is due, at a speed that may change, with pauses and jumps."""

from __future__ import annotations

from zenoh_vision.host.clock import Clock

CATCH_UP_NS = 500_000_000
"""A replay that is later than this was suspended or blocked: it goes on from there. Frames that
were sent in a burst would only overwrite one another."""


class ReplayClock:
    """Maps the times of a recording to those of a clock; not locked.

    Args:
        clock: Tells the time now.
        position_ns: Where in the recording to begin, ns since 1970.
        speed: Seconds of the recording in a second; 0: as fast as possible.
        paused: Whether to begin paused.

    Attributes:
        speed: As it is now; ``set`` changes it, and ``paused``.
        paused: Whether the time of the recording stands still.
    """

    def __init__(
        self, clock: Clock, position_ns: int, speed: float = 1.0, *, paused: bool = False
    ) -> None:
        self._clock = clock
        self.speed = speed
        self.paused = paused
        self.jump(position_ns)

    def jump(self, position_ns: int) -> None:
        """Go on from another moment of the recording."""
        self._position_ns = position_ns
        self._since_ns = self._clock.monotonic_ns()
        self._wall_ns = self._clock.time_ns()

    @property
    def position_ns(self) -> int:
        """The moment of the recording that is due now; at speed 0, that of the last record."""
        if self.paused or not self.speed:
            return self._position_ns
        passed_ns = self._clock.monotonic_ns() - self._since_ns
        return self._position_ns + round(passed_ns * self.speed)

    def set(self, speed: float, *, paused: bool) -> None:
        """Go on from here at a speed, or pause."""
        if (speed, paused) != (self.speed, self.paused):
            here_ns = self.position_ns
            self.speed, self.paused = speed, paused
            self.jump(here_ns)

    def wait_s(self, moment_ns: int) -> float | None:
        """Return how long to wait until a moment is due, seconds; None while paused.

        A moment that is due since over ``CATCH_UP_NS`` becomes the present one.
        """
        if self.paused:
            return None
        if not self.speed:
            self._position_ns = max(self._position_ns, moment_ns)
            return 0.0
        wait_ns = round((moment_ns - self.position_ns) / self.speed)
        if wait_ns < -CATCH_UP_NS:
            self.jump(moment_ns)
        return max(0.0, wait_ns / 1e9)

    def wall_ns(self, moment_ns: int) -> int:
        """Return the wall-clock time at which a moment is due, or was; now if that is unknown."""
        if self.paused or not self.speed:
            return self._clock.time_ns()
        return self._wall_ns + round((moment_ns - self._position_ns) / self.speed)
