"""Logs drops once per burst, so that a flood of bad payloads does not flood the log."""

from __future__ import annotations

import logging
import threading
from collections import Counter

from zenoh_vision.errors import PayloadError

QUIET_S = 5.0
"""A burst ends after this long without another drop for the same reason."""


class LogThrottle:
    """Logs the first drop of a burst, and how many followed when the burst is over."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._last_s: dict[str, float] = {}
        self._suppressed: Counter[str] = Counter()
        self._lock = threading.Lock()

    def note(self, error: PayloadError, at_s: float) -> None:
        """Log a drop if it begins a burst of its reason; else count it."""
        with self._lock:
            known = error.reason in self._last_s
            self._last_s[error.reason] = at_s
            if known:
                self._suppressed[error.reason] += 1
                return
        self._log.warning("dropped a sample, %s", error)

    def flush(self, at_s: float) -> None:
        """Log a summary of the bursts that have ended."""
        with self._lock:
            over = [reason for reason, s in self._last_s.items() if at_s - s > QUIET_S]
            for reason in over:
                del self._last_s[reason]
            suppressed = {reason: self._suppressed.pop(reason, 0) for reason in over}
        for reason, count in suppressed.items():
            if count:
                self._log.warning("dropped %d more samples as %s", count, reason)

    def current(self) -> list[str]:
        """Return the reasons of the bursts that are not over."""
        with self._lock:
            return sorted(self._last_s)
