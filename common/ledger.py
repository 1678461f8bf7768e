"""Counts that balance: what came in = what was done + what was dropped + what is pending."""

from __future__ import annotations

import threading
from collections import Counter


class Ledger:
    """Totals of one node since its start; every change keeps the balance.

    Args:
        arrived: Counter name of what comes in: ``captured`` at a camera, else ``received``.
        done: Counter name of what was dealt with: ``published`` or ``processed``.

    Attributes:
        arrived: As given.
        done: As given.
    """

    def __init__(self, arrived: str = "received", done: str = "processed") -> None:
        self.arrived = arrived
        self.done = done
        self._arrived = 0
        self._done = 0
        self._dropped: Counter[str] = Counter()
        self._notes: Counter[str] = Counter()
        self._lock = threading.Lock()

    def arrive(self) -> None:
        """Count one more in; it is pending until ``finish`` or ``drop``."""
        with self._lock:
            self._arrived += 1

    def finish(self) -> None:
        """Count one pending item as done."""
        with self._lock:
            self._done += 1

    def drop(self, reason: str) -> None:
        """Count one pending item as dropped."""
        with self._lock:
            self._dropped[reason] += 1

    def note(self, name: str, amount: int = 1) -> None:
        """Count something that is no part of the balance, such as ``missed`` frames."""
        with self._lock:
            self._notes[name] += amount

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
