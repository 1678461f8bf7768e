"""Exponential backoff between attempts, for the launcher's processes and the camera's source."""

from __future__ import annotations


class Backoff:
    """Delays that double from attempt to attempt. It has no clock: the caller does the waiting.

    Attributes:
        first_s: Delay before the first attempt, seconds; may be changed at any time.
        longest_s: Upper limit of the delays after the first; may be changed at any time.
    """

    def __init__(self, first_s: float, longest_s: float) -> None:
        self.first_s = first_s
        self.longest_s = longest_s
        self._last_s: float | None = None

    def next_delay_s(self) -> float:
        """Return the delay before the next attempt, and count that attempt."""
        last_s = self._last_s
        self._last_s = self.first_s if last_s is None else min(2.0 * last_s, self.longest_s)
        return self._last_s

    def reset(self) -> None:
        """Start again with the first delay, since an attempt succeeded."""
        self._last_s = None
