"""When a source is opened again: at once, or after a delay that grows. No clock in here."""

from __future__ import annotations

from typing import Protocol

LEAVE_S = 2.0
"""How long a source that is to be opened again gets for being closed."""


class Leaving(Protocol):
    """Who still has the source."""

    @property
    def gone(self) -> bool:
        """Whether it is closed."""


class Reopening:
    """The delay doubles from one opening to the next until a picture comes."""

    def __init__(self) -> None:
        self._delay_s: float | None = None
        self._due_s: float | None = None
        self._leave_s = 0.0
        self.leaving: Leaving | None = None

    @property
    def planned(self) -> bool:
        """Whether the source is to be opened again."""
        return self._due_s is not None

    def due(self, now_s: float) -> bool:
        """Tell whether it is time, by the monotonic clock: two cannot have one device."""
        if self._due_s is None or now_s < self._due_s:
            return False
        return self.leaving is None or self.leaving.gone or now_s >= self._leave_s

    def plan(self, now_s: float, least_s: float, most_s: float) -> float:
        """Plan to open the source again after the delay, and return that.

        Args:
            now_s: Monotonic clock, seconds.
            least_s: The first delay.
            most_s: No delay grows beyond this.
        """
        delay_s = least_s if self._delay_s is None else self._delay_s
        self._due_s = now_s + delay_s
        self._delay_s = min(delay_s * 2, most_s)
        return delay_s

    def plan_at_once(self, now_s: float, leaving: Leaving) -> None:
        """Plan to open it as soon as it is closed, and the next time after the first delay."""
        self._due_s = now_s
        self._delay_s = None
        self.leaving, self._leave_s = leaving, now_s + LEAVE_S

    def begun(self) -> None:
        """Take note that it is being opened."""
        self._due_s = None
        self.leaving = None

    def succeeded(self) -> None:
        """Take note that a picture came: the next delay is the first again."""
        self._delay_s = None
