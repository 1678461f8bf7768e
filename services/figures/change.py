"""What a node's counters did between two of its reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

UNWANTED = "no_subscriber"
"""Frames that nobody wanted are no loss."""

UNWATCHED = "unwatched"
"""Nor are those at a viewer whose last client has just left."""

MISSED = "missed"
"""Stands outside the balance: frames that never arrived, known from gaps in their numbers."""


@dataclass(frozen=True, slots=True)
class Change:
    """Counts of the time between two reports.

    Attributes:
        span_s: How long that was.
        arrived: Frames captured or received.
        done: Frames published or processed.
        losses: Frames lost, by reason: what was dropped, and ``missed``. None is 0.
    """

    span_s: float
    arrived: int
    done: int
    losses: dict[str, int]

    @property
    def lost(self) -> float:
        """The share of frames that were lost, of all that should have been used: 0 to 1."""
        there_were = self.arrived + self.losses.get(MISSED, 0)
        return min(1.0, sum(self.losses.values()) / there_were) if there_were else 0.0

    def share(self, reason: str) -> float:
        """Return the share that was lost for one reason: 0 to 1."""
        there_were = self.arrived + self.losses.get(MISSED, 0)
        return min(1.0, self.losses.get(reason, 0) / there_were) if there_were else 0.0


def change_between(
    before: Mapping[str, int], after: Mapping[str, int], span_s: float
) -> Change | None:
    """Return what happened between two states of a node's counters; None if one was reset."""
    change = {name: count - before.get(name, 0) for name, count in after.items()}
    if any(count < 0 for name, count in change.items() if name != "pending") or span_s <= 0:
        return None
    return Change(
        span_s=span_s,
        arrived=change.get("captured", change.get("received", 0)),
        done=change.get("published", change.get("processed", 0)),
        losses=losses(change),
    )


def losses(counters: Mapping[str, int]) -> dict[str, int]:
    """Return the frames lost by reason, the most frequent first."""
    found = {
        name.removeprefix("dropped."): count
        for name, count in counters.items()
        if (name.startswith("dropped.") or name == MISSED) and count
    }
    for reason in (UNWANTED, UNWATCHED):
        found.pop(reason, None)
    return dict(sorted(found.items(), key=lambda item: -item[1]))
