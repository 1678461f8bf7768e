"""Waits until pictures are due, and looks again when the settings change meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from services.camera.pacing import Pacer, Schedule

LONGEST_WAIT_S = 60.0


class Timing:
    """When the pictures of one source are handed over.

    Args:
        rate_hz: So many a second at the moment; None: as the source has it.
    """

    def __init__(self, rate_hz: Callable[[], float | None]) -> None:
        self._rate_hz = rate_hz
        self._pacer = Pacer()
        self._schedule = Schedule()
        self._shown_s = 0.0
        self._waits = False
        self._waited_s = 0.0
        self._disturbed = threading.Event()
        self._stopped = threading.Event()

    @property
    def stopped(self) -> bool:
        """Whether ``stop`` was called."""
        return self._stopped.is_set()

    def look_again(self) -> None:
        """Have a wait that lasts find out anew how long it is; from any thread."""
        self._disturbed.set()

    def stop(self) -> None:
        """End all waits; from any thread."""
        self._stopped.set()
        self._disturbed.set()

    def busy_since_s(self, since_s: float) -> float | None:
        """Return since when something is done that began then; None during a wait in it."""
        return None if self._waits else max(since_s, self._waited_s)

    def wait_for(self, own_s: float) -> bool:
        """Wait until the picture is due that is at some time of its source.

        Returns:
            False if stopped meanwhile.
        """
        on = self.wait(lambda: self._schedule.due_s(own_s, self._rate_hz()))
        self._shown_s = self._schedule.due_s(own_s, self._rate_hz())
        self._schedule.shown(own_s, self._shown_s)
        return on

    def linger(self, period_s: float) -> None:
        """Wait until the last picture has been shown for so long."""
        self.wait(lambda: self._shown_s + period_s)

    def wait(self, due: Callable[[], float | None]) -> bool:
        """Wait until something is due.

        Args:
            due: When, in seconds after the source's first picture; None: at once. Asked again
                when the settings have changed.

        Returns:
            False if stopped meanwhile.
        """
        while True:
            self._disturbed.clear()  # before the other is looked at, which is set first
            if self.stopped:
                return False
            due_s = due()
            wait_s = 0.0 if due_s is None else self._pacer.wait_s(due_s, time.monotonic())
            if wait_s <= 0:
                return True
            self._waits = True
            self._disturbed.wait(min(wait_s, LONGEST_WAIT_S))
            self._waited_s = time.monotonic()
            self._waits = False
