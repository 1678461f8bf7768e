"""Counters that balance: arrived = done + dropped + pending."""

from __future__ import annotations

import threading
from collections import Counter

from zenoh_vision.messages import MAX_COUNT


class FrameCounters:
    """Totals of one node since its start; safe between threads.

    Attributes:
        arrived: Name of the counter of arrivals: ``captured`` at a camera, else ``received``.
        done: Name of the counter of finished items: ``published`` or ``processed``.
    """

    def __init__(self, arrived: str = "received", done: str = "processed") -> None:
        self.arrived = arrived
        self.done = done
        self._arrived = 0
        self._done = 0
        self._dropped: Counter[str] = Counter()
        self._notes: Counter[str] = Counter()
        self._lock = threading.Lock()

    def arrive(self, count: int = 1) -> None:
        """Count arrivals; each is pending until ``finish`` or ``drop``."""
        with self._lock:
            self._arrived += count

    def finish(self) -> None:
        """Count one pending item as done."""
        with self._lock:
            self._done += 1

    def drop(self, reason: str, count: int = 1) -> None:
        """Count pending items as dropped."""
        with self._lock:
            self._dropped[reason] += count

    def note(self, name: str, amount: int = 1) -> None:
        """Count something outside the balance, such as ``missed`` frames.

        The amount may come from a frame's header, so the total stops at the highest number that
        diagnostics can hold.
        """
        with self._lock:
            self._notes[name] = min(MAX_COUNT, self._notes[name] + amount)

    def snapshot(self) -> dict[str, int]:
        """Return all counters at one moment; they balance."""
        with self._lock:
            return {
                self.arrived: self._arrived,
                self.done: self._done,
                **{f"dropped.{reason}": count for reason, count in sorted(self._dropped.items())},
                "pending": self._arrived - self._done - self._dropped.total(),
                **self._notes,
            }
