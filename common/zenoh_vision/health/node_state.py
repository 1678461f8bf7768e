"""The state of one node: whether it is alive, its description and its newest diagnostics."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from zenoh_vision.health.counter_change import CounterChange, counter_change
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter

S = 1_000_000_000

MAX_REPORTS = 8
"""Most reports kept of one node. Of more in the fleet's window, the first and the newest stay."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How far a node's clock is ahead of ours, measured by one query.

    Attributes:
        ahead_ns: Nanoseconds; negative if it is behind.
        error_ns: Half the round trip, by which the offset may be wrong.
    """

    ahead_ns: int
    error_ns: int


@dataclass(frozen=True, slots=True)
class NodeState:
    """The state of one node, as far as known.

    Attributes:
        session: Zenoh id of the session that answered for it, which distinguishes two nodes of
            one name; empty if nodes are followed by their tokens, which two such nodes share.
        since_ns: When it last appeared or disappeared.
        has_token: Whether it ever had a liveliness token; if not, its diagnostics are its only
            sign of life.
        answered: Whether it has described itself in this run, or when last queried.
        description: The newest one, perhaps from its former run.
        reports: Its diagnostics within the fleet's window, the newest last.
        reported_ns: When the newest arrived.
        clock: Its clock compared with ours, by its quickest answer.
    """

    name: str
    session: str = ""
    alive: bool = True
    since_ns: int = 0
    has_token: bool = False
    answered: bool = False
    description: NodeDescription | None = None
    reports: tuple[Diagnostics, ...] = ()
    reported_ns: int = 0
    clock: ClockOffset | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)

    @property
    def report(self) -> Diagnostics | None:
        """Its newest diagnostics in this run."""
        return self.reports[-1] if self.reports else None

    @property
    def change(self) -> CounterChange | None:
        """The change of its counters within the fleet's window; None before two diagnostics."""
        if len(self.reports) < 2:
            return None
        first, last = self.reports[0], self.reports[-1]
        return counter_change(first.counters, last.counters, last.uptime_s - first.uptime_s)

    @property
    def silent_s(self) -> float | None:
        """Seconds from its newest diagnostics to its description, by its own clock."""
        return self._described_s_after(self.report.stamp_ns if self.report else None)

    @property
    def uptime_s(self) -> float | None:
        """Seconds from its start to its description, by its own clock."""
        return self._described_s_after(self.description.started_ns if self.description else None)

    @property
    def order(self) -> tuple[str, int, str]:
        """Key to sort by: the name, the start, the session."""
        return self.name, self.description.started_ns if self.description else 0, self.session

    def report_age_s(self, at_ns: int) -> float:
        """Return the seconds since its newest diagnostics arrived."""
        return max(0, at_ns - self.reported_ns) / S

    def with_report(self, report: Diagnostics, at_ns: int, window_s: float) -> NodeState:
        """Return the state after diagnostics that arrived at a time."""
        kept = self.reports
        if kept and report.uptime_s < kept[-1].uptime_s:
            kept = ()  # started again
        uptime_s = report.uptime_s  # replaces a report of the same uptime
        kept = tuple(r for r in kept if uptime_s - window_s <= r.uptime_s < uptime_s)
        if len(kept) >= MAX_REPORTS:
            kept = (kept[0], *kept[len(kept) + 2 - MAX_REPORTS :])
        return replace(self, reports=(*kept, report), reported_ns=at_ns)

    def _described_s_after(self, at_ns: int | None) -> float | None:
        if at_ns is None or self.description is None:
            return None
        return max(0, (self.description.stamp_ns or time.time_ns()) - at_ns) / S
