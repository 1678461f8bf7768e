"""The change of a node's counters between two of its diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

NOT_LOST = ("no_subscriber", "unwatched", "unready", "unread", "duplicate")
"""Drop reasons that are not losses: nobody wanted these frames or was ready for them, or they
arrived already by another transport."""

MISSED = "missed"
"""Counter outside the balance: frames that never arrived, known from gaps in their numbers."""


REPLACED = ("overwritten", "overflow")
"""Drop reasons of items that newer ones replaced before a consumer took them."""


@dataclass(frozen=True, slots=True)
class CounterChange:
    """The change of a node's counters between two of its diagnostics.

    Attributes:
        span_s: Time between the two.
        arrived: Frames captured or received.
        losses: Frames lost by reason, drops and ``missed``; reasons that lost none are left out.
    """

    span_s: float
    arrived: int
    losses: dict[str, int]

    @property
    def lost(self) -> float:
        """The share of frames lost, of all that should have been used: 0 to 1."""
        return self._share(sum(self.losses.values()))

    @property
    def used(self) -> int:
        """Frames that were taken from the buffer, and then processed or dropped."""
        return self.arrived - sum(self.losses.get(reason, 0) for reason in REPLACED)

    def share(self, reason: str) -> float:
        """Return the share of frames lost for one reason: 0 to 1."""
        return self._share(self.losses.get(reason, 0))

    def _share(self, count: int) -> float:
        expected = self.arrived + self.losses.get(MISSED, 0)
        return min(1.0, count / expected) if expected else 0.0


def counter_change(
    before: Mapping[str, int], after: Mapping[str, int], span_s: float
) -> CounterChange | None:
    """Return the change between two states of a node's counters; None if they were reset."""
    change = {name: count - before.get(name, 0) for name, count in after.items()}
    if any(count < 0 for name, count in change.items() if name != "pending") or span_s <= 0:
        return None
    return CounterChange(
        span_s=span_s,
        arrived=change.get("captured", change.get("received", 0)),
        losses=losses(change),
    )


def losses(counters: Mapping[str, int]) -> dict[str, int]:
    """Return the frames lost by reason, the most frequent first."""
    found = {
        name.removeprefix("dropped."): count
        for name, count in counters.items()
        if count and (name.startswith("dropped.") or name == MISSED)
    }
    ordered = sorted(found.items(), key=lambda item: -item[1])
    return {reason: count for reason, count in ordered if reason not in NOT_LOST}
