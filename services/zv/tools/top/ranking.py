"""Sorts the nodes for ``zv top``: those with the worst health first."""

from __future__ import annotations

import socket
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from zenoh_vision.health.counter_change import CounterChange
from zenoh_vision.health.fleet import SILENT_S, Fleet
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import SEVERITY, Level
from zv.status.process_usage import ProcessUsage
from zv.status.row import Row, row_of
from zv.tools.shared.nodes import health_facts, node_facts

WINDOW_S = 5.0
"""Losses are counted over this time, as are rates and latencies in diagnostics."""

NO_ANSWER = max(SEVERITY.values()) + 1
QUIET = SEVERITY[Level.STALE]
"""A node that answers but no longer sends diagnostics ranks like a stale one."""


@dataclass(frozen=True, slots=True)
class Ranked:
    """One node with the values that are shown.

    Attributes:
        cpu: Percent of a core, if it runs on this machine.
        memory_mb: Megabytes, if it runs on this machine.
    """

    node: NodeState
    cpu: float | None = None
    memory_mb: float | None = None

    @property
    def change(self) -> CounterChange | None:
        """The recent change of its counters, if known."""
        return self.node.change if self.node.answered else None

    @property
    def silent_s(self) -> float | None:
        """How long it has sent no diagnostics, if that is too long."""
        silent_s = self.node.silent_s if self.node.answered else None
        return silent_s if silent_s is not None and silent_s > SILENT_S else None

    @property
    def rank(self) -> tuple[int, float, float, str]:
        """Key to sort by: level, share of frames lost, latency; then the name."""
        if not self.node.answered:
            return -NO_ANSWER, 0.0, 0.0, self.node.name
        report, change = self.node.report, self.change
        level = SEVERITY[report.level] if report else 0
        if self.silent_s is not None:
            level = max(level, QUIET)
        latency_ms = (report.latency_ms.p99 if report else None) or 0.0
        return -level, -(change.lost if change else 0.0), -latency_ms, self.node.name


class Ranking:
    """Follows the nodes by snapshots and ranks them."""

    def __init__(self) -> None:
        self._fleet = Fleet(window_s=WINDOW_S)
        self._usage = ProcessUsage()
        self._measured: set[tuple[int, int]] = set()
        self._host = socket.gethostname()

    def update(self, found: Sequence[NodeState]) -> list[Ranked]:
        """Take a snapshot of all nodes and return them, the worst first.

        If most names never answered, those names come last: anyone can show a token.
        """
        self._fleet.update(found)
        ranked = [Ranked(node, *self._usage_of(node)) for node in self._fleet.nodes()]
        silent = sum(each.node.description is None for each in ranked)
        last = 2 * silent > len(ranked)
        return sorted(ranked, key=lambda e: (last and e.node.description is None, e.rank))

    def _usage_of(self, node: NodeState) -> tuple[float | None, float | None]:
        about = node.description
        if about is None or about.host != self._host:
            return None, None
        if (about.pid, about.started_ns) not in self._measured:
            self._measured.add((about.pid, about.started_ns))
            self._usage.begin(about.pid, about.started_ns / 1e9)
            return None, None  # CPU time is measured between two readings
        return self._usage.read(about.pid)


def rows_of(ranked: Sequence[Ranked]) -> list[Row]:
    """Return the rows of the table, with hosts if there are several, and pids for equal names."""
    hosts = {each.node.description.host for each in ranked if each.node.description}
    names = Counter(each.node.name for each in ranked)
    return [_row(each, len(hosts) > 1, names[each.node.name] > 1) for each in ranked]


def _row(ranked: Ranked, show_host: bool, show_pid: bool) -> Row:
    node = ranked.node
    about = node.description
    if about is None or not node.answered:
        return Row(node.name, "no answer")
    name = f"{node.name} ({about.pid})" if show_pid else node.name
    host = about.host if show_host else ""
    if ranked.silent_s is not None:
        return Row(name, f"silent for {ranked.silent_s:.0f} s", host=host)
    if node.report is None:
        return Row(name, "starting", host=host)
    return row_of(
        name,
        node.report,
        cpu=ranked.cpu,
        memory_mb=ranked.memory_mb,
        lost=ranked.change.lost if ranked.change else None,
        host=host,
    )


def record_of(ranked: Ranked) -> dict[str, Any]:
    """Return the fields of a node for JSON."""
    change = ranked.change
    return {
        **node_facts(ranked.node),
        **health_facts(ranked.node),
        "lost": change and change.lost,
        "losses": change and change.losses,
        "cpu_percent": ranked.cpu,
        "memory_mb": ranked.memory_mb,
        "silent_s": ranked.silent_s,
    }
