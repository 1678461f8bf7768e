"""The clocks of this machine, behind an interface that a test or a replay can drive instead."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What a node reads the time from, and sleeps by."""

    def monotonic_ns(self) -> int:
        """Return the time since some moment, ns; never runs backwards."""

    def time_ns(self) -> int:
        """Return the wall-clock time, ns since 1970; may be set, also backwards."""

    def sleep(self, seconds: float) -> None:
        """Wait."""


class SystemClock:
    """The clock of the operating system."""

    monotonic_ns = staticmethod(time.monotonic_ns)
    time_ns = staticmethod(time.time_ns)
    sleep = staticmethod(time.sleep)


SYSTEM_CLOCK: Clock = SystemClock()
