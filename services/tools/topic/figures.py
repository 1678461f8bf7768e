"""Rates, spreads and gaps from times and numbers alone; no network, no clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

MOST_EPOCHS = 8
MOST_MISSING = 10_000


@dataclass(frozen=True, slots=True)
class Spread:
    """How values are spread; percentiles by nearest rank, deviation of the population."""

    count: int
    mean: float
    minimum: float
    maximum: float
    deviation: float
    p50: float
    p99: float


def spread(values: Sequence[float]) -> Spread | None:
    """Return the spread of some values; None if there are none."""
    if not values:
        return None
    ordered = sorted(values)
    count = len(ordered)
    mean = math.fsum(ordered) / count
    variance = math.fsum((value - mean) ** 2 for value in ordered) / count
    p50, p99 = (ordered[math.ceil(count * percent / 100) - 1] for percent in (50, 99))
    return Spread(count, mean, ordered[0], ordered[-1], math.sqrt(variance), p50, p99)


def rate_of(times_s: Sequence[float], begin_s: float, end_s: float) -> float:
    """Return messages per second; 0 if there are fewer than two.

    The time before the first and after the last counts only as far as it is longer than the
    mean period: else the rate of a steady stream would come out too low, and without it that of
    one that came late or stopped too high.

    Args:
        times_s: Of the messages, ascending.
        begin_s: Since when one listens.
        end_s: Now.
    """
    if len(times_s) < 2:
        return 0.0
    periods = len(times_s) - 1
    span_s = times_s[-1] - times_s[0]
    period_s = span_s / periods
    late_s = max(0.0, times_s[0] - begin_s - period_s)
    overdue_s = max(0.0, end_s - times_s[-1] - period_s)
    return periods / max(span_s + late_s + overdue_s, 1e-6)


@dataclass(slots=True)
class _Epoch:
    newest: int
    missing: set[int] = field(default_factory=set)
    forgotten: int = 0


class Gaps:
    """Sequence numbers that never came, within each epoch.

    One that comes late is no longer lost, and one that comes twice is told apart.
    """

    def __init__(self) -> None:
        self.repeated = 0
        self.restarts = 0
        self._epochs: dict[int, _Epoch] = {}
        self._settled = 0

    @property
    def lost(self) -> int:
        """How many are missing."""
        open_ = sum(len(epoch.missing) + epoch.forgotten for epoch in self._epochs.values())
        return self._settled + open_

    def note(self, epoch: int, seq: int) -> None:
        """Take note of a message."""
        known = self._epochs.get(epoch)
        if known is None:
            self._begin(epoch, seq)
        elif seq > known.newest:
            gap = seq - known.newest - 1
            kept = min(gap, max(0, MOST_MISSING - len(known.missing)))
            known.missing.update(range(seq - kept, seq))
            known.forgotten += gap - kept
            known.newest = seq
        elif seq in known.missing:
            known.missing.discard(seq)
        else:
            self.repeated += 1

    def _begin(self, epoch: int, seq: int) -> None:
        if self._epochs:
            self.restarts += 1
        if len(self._epochs) == MOST_EPOCHS:
            oldest = self._epochs.pop(next(iter(self._epochs)))
            self._settled += len(oldest.missing) + oldest.forgotten
        self._epochs[epoch] = _Epoch(seq)
