"""Detects rates that are too low: of a source, or of a consumer that is too slow. Uses no clock.

Both checks compare one rate with another. A rate near a limit, or a gap of a second, must not make
a node's level flap. So a warning begins only when a shortfall lasts, and ends only when the rate
has clearly recovered for a while.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from zenoh_vision.health.counter_change import REPLACED

TOO_LOW = 0.9
GOOD_AGAIN = 0.95
WINDOW_S = 3.0
FRAMES = 20
"""Fewest frames to judge a rate by: one frame more or less is then 5 %, within the limits above."""

MAX_WINDOW_S = 200.0
"""Seconds. Rates of less than ``FRAMES`` frames in this time (0.1 Hz) are not judged."""

MAX_USE_WINDOW_S = 30.0
"""Seconds. A stream of fewer than ``FRAMES`` frames in this time is never too fast."""


class Shortfall:
    """A ratio that should be 1, judged with hysteresis in height and in time."""

    def __init__(self) -> None:
        self.present = False
        self._since_s: float | None = None

    def judge(self, at_s: float, ratio: float | None, window_s: float) -> bool:
        """Take the newest ratio and tell whether it falls short.

        Args:
            at_s: Monotonic time.
            ratio: Actual value divided by the expected one; None when there is nothing to compare.
            window_s: Time over which the ratio was measured. A shortfall begins when the ratio has
                been too low for twice this time, and ends when it has been good for this time.
        """
        if ratio is None:
            self.present = False
            self._since_s = None
            return False
        other_way = ratio >= GOOD_AGAIN if self.present else ratio < TOO_LOW
        if not other_way:
            self._since_s = None
            return self.present
        if self._since_s is None:
            self._since_s = at_s
        if at_s - self._since_s >= (window_s if self.present else 2 * window_s):
            self.present = not self.present
            self._since_s = None
        return self.present


class Reading(NamedTuple):
    """Totals of a node at a monotonic time."""

    at_s: float
    arrived: int
    replaced: int


class RateMonitor:
    """Judges a node's rates by its counters, read about once a second.

    ``arrived`` is the name of the counter of arrivals: ``captured`` or ``received``.
    """

    def __init__(self, arrived: str) -> None:
        self._arrived = arrived
        self._wanted_hz: float | None = None
        self._expected_hz: float | None = None
        self._readings: deque[Reading] = deque()
        self._slow_source = Shortfall()
        self._slow_use = Shortfall()

    def expect(self, rate_hz: float | None) -> None:
        """Set the rate that should arrive, None if none is known; from any thread."""
        self._wanted_hz = rate_hz

    @property
    def expected_hz(self) -> float | None:
        """The rate that should arrive, None if none is known."""
        return self._wanted_hz

    def restart(self) -> None:
        """Forget all readings, since they do not apply to later frames."""
        self._readings.clear()
        self._slow_source = Shortfall()
        self._slow_use = Shortfall()

    def judge(self, at_s: float, counters: dict[str, int]) -> list[str]:
        """Return what is wrong with the rates, by the node's totals at a monotonic time."""
        if self._expected_hz != self._wanted_hz:
            self._expected_hz = self._wanted_hz
            self.restart()
        replaced = sum(counters.get(f"dropped.{reason}", 0) for reason in REPLACED)
        now = Reading(at_s, counters[self._arrived], replaced)
        self._readings.append(now)
        while at_s - self._readings[0].at_s > MAX_WINDOW_S + WINDOW_S:
            self._readings.popleft()
        return [*self._judge_source(now), *self._judge_use(now)]

    def _judge_source(self, now: Reading) -> list[str]:
        expected_hz = self._expected_hz
        if expected_hz is None or FRAMES / expected_hz > MAX_WINDOW_S:
            return []
        window_s = max(WINDOW_S, FRAMES / expected_hz)
        before = self._before(now, window_s)
        rate_hz = 0.0 if before is None else (now.arrived - before.arrived) / _span_s(before, now)
        ratio = None if before is None else rate_hz / expected_hz
        if not self._slow_source.judge(now.at_s, ratio, window_s):
            return []
        under = "was under" if ratio is not None and ratio >= GOOD_AGAIN else "under"
        return [f"{_hz(rate_hz)} {self._arrived}, {under} the {expected_hz:g} Hz configured"]

    def _judge_use(self, now: Reading) -> list[str]:
        before = self._before(now, WINDOW_S, FRAMES)
        if before is None or _span_s(before, now) > MAX_USE_WINDOW_S:
            self._slow_use.judge(now.at_s, None, WINDOW_S)
            return []
        span_s = _span_s(before, now)
        arrived = now.arrived - before.arrived
        used = arrived - (now.replaced - before.replaced)
        if not self._slow_use.judge(now.at_s, used / arrived, span_s):
            return []
        latest = self._before(now, WINDOW_S)
        if latest is None or latest.arrived == now.arrived:
            return []  # a node that nothing has arrived at lately is not slow
        slower = "was slower" if used / arrived >= GOOD_AGAIN else "slower"
        return [
            f"{slower} than its stream: {_hz(arrived / span_s)} {self._arrived}, "
            f"{_hz(used / span_s)} used"
        ]

    def _before(self, now: Reading, window_s: float, frames: int = 0) -> Reading | None:
        """Return the newest reading before the window and at least so many frames ago, or None."""
        for reading in reversed(self._readings):
            if _span_s(reading, now) >= window_s and now.arrived - reading.arrived >= frames:
                return reading
        return None


def _span_s(before: Reading, now: Reading) -> float:
    return now.at_s - before.at_s


def _hz(rate_hz: float) -> str:
    return f"{rate_hz:.1f} Hz" if rate_hz >= 10 else f"{rate_hz:.2g} Hz"
