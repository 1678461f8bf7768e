"""Finds when the pictures of a live stream were captured, by the times in the stream. No clock."""

from __future__ import annotations

import math

DRIFT = 200e-6
"""Largest difference between the speeds of two quartz clocks."""

JUMP_S = 10.0
"""A stream's clock that gains this much on the arrival of its packets, or goes back by a second,
was set: its pictures are not that early."""
BACK_S = 1.0

AHEAD_S = 0.05
MAX_DELAY_S = 0.5
"""A camera's clock is taken to be this machine's if its packets seem to have been sent at most so
long before, or at most ``AHEAD_S`` after, they arrived. No camera and network need longer for the
fastest packet; a clock that is slow by more would make all pictures seem old."""

MAX_CORRECTION_NS = 1_000_000_000
"""A stamp that is earlier than the last one by less than this comes from a better knowledge of the
delay, and is raised: no picture was captured before the one before it."""


def stamp_ns(age_s: float, now_ns: int, last_ns: int) -> int:
    """Return the stamp of a picture, ns since 1970, later than that of the one before it.

    Args:
        age_s: Time since its capture, seconds.
        now_ns: This machine's wall clock, ns since 1970.
        last_ns: Stamp of the picture before; 0 if there is none.
    """
    found_ns = now_ns - round(max(0.0, age_s) * 1e9)
    return last_ns + 1 if 0 <= last_ns - found_ns < MAX_CORRECTION_NS else found_ns


class StreamClock:
    """Maps the times of one stream to this machine's monotonic clock.

    The origin of a stream's times is unknown. The packet that came fastest is taken to have taken
    no time, so that what the network delays is no motion, and what waited is as old as it is. If
    the camera tells the wall clock of its times (RTCP sender reports) and that clock is right, the
    whole delay is known.

    Attributes:
        ahead_s: By how much the camera's clock is ahead of this machine's, if it tells it and if it
            is not the same; else None.
        is_camera_clock: Whether stamps are those of the camera's own clock.
    """

    def __init__(self) -> None:
        self.ahead_s: float | None = None
        self.is_camera_clock = False
        self._origin_s = math.inf
        self._last: tuple[float, float] | None = None
        self._least_delay_s = math.inf

    def arrive(self, time_s: float, arrived_s: float, delay_s: float | None = None) -> None:
        """Record the arrival of a packet.

        Args:
            time_s: Its time in the stream, seconds.
            arrived_s: Monotonic time of its arrival, seconds.
            delay_s: Arrival minus capture by the wall clocks of this machine and of the camera;
                None if the camera does not tell.
        """
        origin_s = arrived_s - time_s
        if delay_s is not None:
            self._least_delay_s = min(self._least_delay_s, delay_s)
            self.is_camera_clock = -AHEAD_S <= self._least_delay_s <= MAX_DELAY_S
            self.ahead_s = None if self.is_camera_clock else -self._least_delay_s
            if self.is_camera_clock:
                self._origin_s = origin_s - max(0.0, delay_s)
                self._last = time_s, arrived_s
                return
        if self._last is not None:
            passed_s, gained_s = arrived_s - self._last[1], time_s - self._last[0]
            if gained_s < -BACK_S or gained_s - passed_s > JUMP_S:
                self._origin_s = math.inf
            self._origin_s += DRIFT * max(0.0, passed_s)
        self._origin_s = min(self._origin_s, origin_s)
        self._last = time_s, arrived_s

    def captured_s(self, time_s: float) -> float | None:
        """Return the monotonic time at which a picture was captured; None before the first."""
        return None if math.isinf(self._origin_s) else time_s + self._origin_s
