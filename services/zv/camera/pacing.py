"""Delays pictures until they are due, for sources without a clock of their own."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from zenoh_vision.host.wakeup import Wakeup

LONGEST_WAIT_S = 60.0
SLACK_S = 0.1
"""How late a picture may be without shifting those after it."""

LONGEST_REST_S = 0.05
"""Less than ``SLACK_S``, since the next picture may be due soon after a pause."""


class Schedule:
    """Computes when each picture is due, at a rate that may change at any time. It has no clock.

    Attributes:
        rate_hz: Pictures per second, whatever the source's clock says; None to follow it.
    """

    def __init__(self) -> None:
        self.rate_hz: float | None = None
        self._count = 0
        self._rate_hz: float | None = None
        self._last = (0.0, 0.0)
        self._origin = (0, 0.0, 0.0)

    def due_s(self, source_s: float) -> float:
        """Return when the next picture is due, seconds after the first; changes no count.

        ``source_s`` is the time of the picture on the source's own clock.
        """
        rate_hz = self.rate_hz
        if rate_hz != self._rate_hz:
            self._rate_hz = rate_hz
            self._origin = (max(0, self._count - 1), *self._last)
        number, origin_source_s, origin_s = self._origin
        if rate_hz is None:
            return origin_s + source_s - origin_source_s
        return origin_s + (self._count - number) / rate_hz

    def advance(self, source_s: float, due_s: float) -> None:
        """Advance to the picture after the one with these times."""
        self._count += 1
        self._last = (source_s, due_s)


class PictureTimer:
    """Waits on the reading thread until pictures are due; other threads can interrupt the wait.

    Each picture is due at a fixed time after the first, so a late picture does not delay the next.
    A picture later than ``SLACK_S`` (the machine slept, decoding is too slow) shifts those after it
    instead, since the pictures of a burst would only overwrite one another.

    Args:
        rate_hz: Returns the rate to impose, pictures per second; None to follow the source's own
            times. Called again after each change of the settings.

    Attributes:
        blocked_since_s: Start of the reader's current blocking call, monotonic; None outside of
            one. The reader sets it; it is None while the timer waits.
        stopped: Whether ``stop`` was called.
    """

    def __init__(self, rate_hz: Callable[[], float | None]) -> None:
        self.blocked_since_s: float | None = None
        self._rate_hz = rate_hz
        self._schedule = Schedule()
        self._first_s: float | None = None  # when the first picture was due
        self._due_s = 0.0
        self._rest_s = 0.0
        self._wake = Wakeup()
        self._is_changed = True
        self.stopped = False

    def settings_changed(self) -> None:
        """Compute the current wait again; called from any thread."""
        self._is_changed = True
        self._wake.set()

    def stop(self) -> None:
        """End the current wait and all later ones; called from any thread."""
        self.stopped = True
        self._wake.set()

    def rest(self) -> None:
        """Wait for half of the idle time before a picture is read ahead of its time.

        The last picture is processed in this time, and reading must not take the CPU from that. A
        change of the settings ends the wait.
        """
        self._wake.wait(self._rest_s)

    def wait_for_picture(self, source_s: float) -> bool:
        """Wait until the picture with this time on the source's clock is due.

        Returns:
            False if stopped meanwhile.
        """
        begun_s = time.monotonic()
        running = self.wait_until(partial(self._schedule.due_s, source_s))
        early_s = time.monotonic() - begun_s
        rest_s = min((self._rest_s + early_s) / 2, early_s)  # 0 if the picture is late
        self._rest_s = min(rest_s, LONGEST_REST_S)
        self._schedule.advance(source_s, self._due_s)
        return running

    def wait_after_last(self, period_s: float) -> None:
        """Wait until the last picture has been shown for a period."""
        end_s = self._due_s + period_s
        self.wait_until(lambda: end_s)

    def wait_until(self, due: Callable[[], float | None]) -> bool:
        """Wait until a time that may change meanwhile.

        Args:
            due: Returns the time, seconds after the source's first picture; None for now. Called
                again after each change of the settings.

        Returns:
            False if stopped meanwhile.
        """
        is_known = False
        while not self.stopped:
            if self._is_changed:
                self._is_changed = is_known = False
                self._schedule.rate_hz = self._rate_hz()
            if not is_known:
                if (due_s := due()) is None:
                    return True
                self._due_s, is_known = due_s, True
            now_s = time.monotonic()
            if self._first_s is None:
                self._first_s = now_s - self._due_s
            wait_s = self._first_s + self._due_s - now_s
            if wait_s < -SLACK_S:
                self._first_s -= wait_s
            if wait_s <= 0:
                return True
            was_blocked, self.blocked_since_s = self.blocked_since_s is not None, None
            self._wake.wait(min(wait_s, LONGEST_WAIT_S))
            if was_blocked:
                self.blocked_since_s = time.monotonic()
        return False
