"""Predicts a position, and its standard deviation, from earlier positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WINDOWS_S: Final = (0.3, 0.6, 1.2, 2.4)
"""Times over which a straight line is fitted: short ones follow a turn, long ones average noise."""

KEPT_S: Final = 3.0
"""Positions older than this are not used."""

LEAST_POSITIONS: Final = 4
BACKTESTS: Final = 12
"""Number of the newest positions that are predicted from earlier ones, to measure the error."""

LEAST_HORIZON_S: Final = 0.1


class TooShort(ValueError):
    """A path has too few positions for a prediction."""


@dataclass(frozen=True)
class Forecast:
    """A predicted position, with its standard deviation, and a velocity."""

    position: Floats  # (2,), in the unit of the path
    velocity: Floats  # (2,), units per second
    sigma: Floats  # (2,), standard deviation of the position along each axis


def forecast(times_s: Floats, path: Floats, at_s: float, noise: Floats) -> Forecast:
    """Predict the position of an object that continues its path in a straight line.

    A line is fitted by least squares to the newest positions, over the one of ``WINDOWS_S`` which
    gives the least standard deviation. The variance is the sum of three variances: of the fitted
    line, of the positions around the line, and of the velocity times the squared time ahead. The
    last one is measured by backtesting: the newest positions are predicted from earlier ones. It is
    small for an object on a belt, and large for a person who turns back.

    Args:
        times_s: (n,), ascending; time of each position, seconds.
        path: (n, 2), the positions, in any unit.
        at_s: Time of the prediction, seconds; not before the last position.
        noise: (2,), lower bound of a position's standard deviation, in the unit of the path: the
            scatter of smoothed positions around a line is smaller than their error.

    Raises:
        TooShort: There are fewer than ``LEAST_POSITIONS`` positions.
    """
    if len(times_s) < LEAST_POSITIONS:
        raise TooShort(f"seen in {len(times_s)} frames")
    ahead_s = max(LEAST_HORIZON_S, at_s - float(times_s[-1]))
    horizon_s = at_s - float(times_s[-1])
    tried: dict[int, tuple[_Line, Floats]] = {}
    for window_s in WINDOWS_S:
        count = max(LEAST_POSITIONS, _count(times_s, len(times_s), window_s))
        if count not in tried:
            line = _Line.fit(times_s[-count:], path[-count:], noise)
            drift = _velocity_error(times_s, path, window_s, ahead_s, noise)
            tried[count] = line, line.variance(at_s) + line.scatter + (drift * horizon_s) ** 2
    line, variance = min(tried.values(), key=lambda each: float(each[1].sum()))
    return Forecast(line.at(at_s), line.velocity, np.sqrt(variance))


def _velocity_error(
    times_s: Floats, path: Floats, window_s: float, ahead_s: float, noise: Floats
) -> Floats:
    """Return the rms error of the velocity in backtests, (2,), units per second.

    The newest positions are predicted from those up to ``ahead_s`` before, or less if the path is
    short.
    """
    ahead_s = min(ahead_s, float(times_s[-1] - times_s[0]) / 2)
    errors = []
    for index in range(max(LEAST_POSITIONS, len(times_s) - BACKTESTS), len(times_s)):
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
    return end - int(np.searchsorted(times_s[:end], times_s[end - 1] - window_s, side="left"))


@dataclass(frozen=True)
class _Line:
    """A straight line fitted to positions over time by least squares."""

    center_s: float  # mean of the times, seconds
    center: Floats  # mean of the positions, (2,)
    velocity: Floats  # slope of the line, (2,), units per second
    scatter: Floats  # variance of a position around the line, (2,)
    count: int  # number of positions
    spread: float  # sum of the squared differences of the times from their mean

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
        """Return the variance of the fitted line at a time, (2,)."""
        leverage = (at_s - self.center_s) ** 2 / self.spread if self.spread > 0 else 0.0
        return np.asarray(self.scatter * (1 / self.count + leverage))
