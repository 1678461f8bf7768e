"""Logs drops once per burst, and silent inputs once, so that no flood reaches the log."""

from __future__ import annotations

import logging
import threading
from collections import Counter
from collections.abc import Iterable

from zenoh_vision.error_text import joined
from zenoh_vision.errors import PayloadError
from zenoh_vision.stream.intake import InputState

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


SILENT_S = 2.0

AGAIN_S = 60.0
"""Shortest time between two log lines of a stream: a camera may send a frame every few seconds."""

MAX_NAMED = 5


class SilenceLog:
    """Compares the inputs about once a second; uses no clock.

    Args:
        log: Gets a line when inputs fall silent, and another when they are back.
    """

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._reported: set[str] = set()  # streams that are silent, and logged so
        self._logged_s: dict[str, float] = {}  # in the last minute

    def note(self, inputs: Iterable[InputState], now_s: float) -> None:
        """Log what has changed, given the state of each input at a monotonic time."""
        states = {each.stream or each.key: each for each in inputs}
        keys = {name: each.key for name, each in states.items()}
        silent = {name for name, each in states.items() if now_s - each.since_ns / 1e9 > SILENT_S}
        self._logged_s = {name: s for name, s in self._logged_s.items() if now_s - s < AGAIN_S}
        if new := silent - self._reported - self._logged_s.keys():
            self._log.warning(
                "waiting: no frame on %s for %g s",
                joined(sorted(keys[name] for name in new), MAX_NAMED),
                SILENT_S,
            )
            self._logged_s |= dict.fromkeys(new, now_s)
        alive = states.keys() - silent
        # An input with wildcards is listed under its own key until the first frame arrives. Any
        # other key that has disappeared was forgotten.
        if back := {name for name in self._reported if name in alive or (alive and "*" in name)}:
            named = sorted(keys.get(name, name) for name in back)
            self._log.info("frames arrive on %s", joined(named, MAX_NAMED))
        self._reported = (self._reported | new) & silent
