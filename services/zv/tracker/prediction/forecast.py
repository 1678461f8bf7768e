"""Predicts a position from positions before it, and says how far it may be off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WINDOWS_S: Final = (0.3, 0.6, 1.2, 2.4)
"""Times over which a straight line is fitted: short ones follow a turn, long ones average noise."""

KEPT_S: Final = 3.0
"""Positions older than this are of no use."""

LEAST_POSITIONS: Final = 4
HINDSIGHT: Final = 12
"""So many of the newest positions are predicted again to see how well that would have worked."""

LEAST_HORIZON_S: Final = 0.1


class TooShort(ValueError):
    """A path of too few positions for a prediction."""


@dataclass(frozen=True)
class Forecast:
    """A position that is expected, its velocity, and their standard deviations.

    Attributes:
        position: (2,), in the unit of the path.
        velocity: (2,), units per second.
        sigma: (2,), standard deviation of the position along each axis.
    """

    position: Floats
    velocity: Floats
    sigma: Floats


def forecast(times_s: Floats, path: Floats, at_s: float, noise: Floats) -> Forecast:
    """Predict where what followed a path will be, if it goes on in a straight line.

    A line is fitted to the newest positions by least squares, over the one of ``WINDOWS_S`` with
    the least standard deviation. That has two parts: that of a position around the line, and that
    of the velocity times the time ahead; the latter is what the hindsight shows, and at least what
    the scatter of the positions implies. So an object on a belt has a small one, and a person who
    turns about a large one.

    Args:
        times_s: (n,), ascending; when the object was at each position.
        path: (n, 2), in any unit.
        at_s: When the position is wanted; not before the last one.
        noise: (2,), least standard deviation of a position: positions that were smoothed scatter
            less around a line than they are off.

    Raises:
        TooShort: There are fewer than four positions.
    """
    if len(times_s) < LEAST_POSITIONS:
        raise TooShort(f"seen in {len(times_s)} frames")
    ahead_s = max(LEAST_HORIZON_S, at_s - float(times_s[-1]))
    lever_s = at_s - float(times_s[-1])
    tried: dict[int, tuple[_Line, Floats]] = {}
    for window_s in WINDOWS_S:
        count = max(LEAST_POSITIONS, _count(times_s, len(times_s), window_s))
        if count not in tried:
            line = _Line.fit(times_s[-count:], path[-count:], noise)
            drift = _hindsight(times_s, path, window_s, ahead_s, noise)
            tried[count] = line, line.variance(at_s) + line.scatter + (drift * lever_s) ** 2
    line, variance = min(tried.values(), key=lambda each: float(each[1].sum()))
    return Forecast(line.at(at_s), line.velocity, np.sqrt(variance))


def _hindsight(
    times_s: Floats, path: Floats, window_s: float, ahead_s: float, noise: Floats
) -> Floats:
    """Return the rms of what the velocity would have been wrong by, (2,), units per second.

    The newest positions are predicted from those that were known ``ahead_s`` before, or less if
    the path is short.
    """
    ahead_s = min(ahead_s, float(times_s[-1] - times_s[0]) / 2)
    errors = []
    for index in range(max(LEAST_POSITIONS, len(times_s) - HINDSIGHT), len(times_s)):
        known = int(np.searchsorted(times_s, times_s[index] - ahead_s, side="right"))
        if known < LEAST_POSITIONS - 1:
            continue
        count = max(LEAST_POSITIONS - 1, _count(times_s, known, window_s))
        line = _Line.fit(times_s[known - count : known], path[known - count : known], noise)
        horizon_s = float(times_s[index] - times_s[known - 1])
        off2 = (line.at(float(times_s[index])) - path[index]) ** 2
        errors.append(np.maximum(off2 - 2 * line.scatter, 0) / horizon_s**2)
    if not errors:
        return np.zeros(2)
    return np.asarray(np.sqrt(np.mean(errors, axis=0)))


def _count(times_s: Floats, end: int, window_s: float) -> int:
    """Return how many of the first ``end`` positions lie in the window before the last of them."""
    if end == 0:
        return 0
    return end - int(np.searchsorted(times_s[:end], times_s[end - 1] - window_s, side="left"))


@dataclass(frozen=True)
class _Line:
    """A straight line through positions over time, by least squares.

    Attributes:
        center_s: Mean of the times; ``center`` is that of the positions, (2,).
        velocity: (2,), units per second.
        scatter: Variance of a position around the line, (2,).
        count: Number of positions.
        spread: Sum of the squared times from their mean.
    """

    center_s: float
    center: Floats
    velocity: Floats
    scatter: Floats
    count: int
    spread: float

    @classmethod
    def fit(cls, times_s: Floats, path: Floats, noise: Floats) -> _Line:
        center_s, center = float(times_s.mean()), path.mean(axis=0)
        times = times_s - center_s
        spread = float((times**2).sum())
        velocity = times @ (path - center) / spread if spread > 0 else np.zeros(2)
        residuals = path - center - times[:, None] * velocity
        scatter = np.maximum((residuals**2).sum(axis=0) / max(1, len(times_s) - 2), noise**2)
        return cls(center_s, center, velocity, scatter, len(times_s), spread)

    def at(self, at_s: float) -> Floats:
        return self.center + self.velocity * (at_s - self.center_s)

    def variance(self, at_s: float) -> Floats:
        """Return the variance of the line itself at a time, (2,)."""
        lever = (at_s - self.center_s) ** 2 / self.spread if self.spread > 0 else 0.0
        return np.asarray(self.scatter * (1 / self.count + lever))
