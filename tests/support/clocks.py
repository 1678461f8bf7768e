"""A clock that a test moves."""

from __future__ import annotations


class SteppedClock:
    """Time that passes only by ``step`` and ``sleep``."""

    def __init__(self, now_ns: int = 100 * 10**9, wall_ns: int = 1_750_000_000 * 10**9) -> None:
        self.now_ns = now_ns
        self.wall_ns = wall_ns

    def monotonic_ns(self) -> int:
        return self.now_ns

    def time_ns(self) -> int:
        return self.wall_ns

    def step(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
        self.wall_ns += round(seconds * 1e9)

    def sleep(self, seconds: float) -> None:
        self.step(seconds)
