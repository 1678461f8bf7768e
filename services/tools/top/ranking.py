"""The figures of all nodes, those that hurt most first."""

from __future__ import annotations

import socket
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from common.health import SEVERITY
from services.figures.board import SILENT_S
from services.figures.change import Change
from services.figures.meter import Meter
from services.figures.row import Row, row
from services.tools.facts import facts
from services.tools.history import History
from services.tools.nodes import Presence
from services.tools.output import printable

WINDOW_S = 5.0
"""Losses of so long are shown; latencies and rates are of as long."""

NO_ANSWER = max(SEVERITY.values()) + 1
QUIET = SEVERITY[3]
"""A node that answers but reports no health any more hurts as much as one that is stale."""


@dataclass(frozen=True, slots=True)
class Figures:
    """What is shown of one node.

    Attributes:
        presence: The node.
        change: What its counters did lately, None if that is not known yet.
        cpu: Percent of a core, if it runs on this machine.
        memory_mb: Megabytes, if it runs on this machine.
    """

    presence: Presence
    change: Change | None = None
    cpu: float | None = None
    memory_mb: float | None = None

    @property
    def silent_s(self) -> float | None:
        """For how long it has reported nothing, if that is too long."""
        silent_s = self.presence.silent_s
        return silent_s if silent_s is not None and silent_s > SILENT_S else None

    @property
    def pain(self) -> tuple[int, float, float, str]:
        """What nodes are sorted by: level, share of frames lost, latency; then the name."""
        report = self.presence.report
        if self.presence.description is None:
            return -NO_ANSWER, 0.0, 0.0, self.presence.name
        level = SEVERITY[report.level] if report else 0
        if self.silent_s is not None:
            level = max(level, QUIET)
        lost = self.change.lost if self.change else 0.0
        latency_ms = (report.latency_ms.p99 if report else None) or 0.0
        return -level, -lost, -latency_ms, self.presence.name


class Observer:
    """Adds to who is there what became of them since the last look."""

    def __init__(self) -> None:
        self._history = History(WINDOW_S)
        self._meter = Meter()
        self._measured: set[tuple[int, int]] = set()
        self._host = socket.gethostname()

    def look(self, found: Sequence[Presence]) -> list[Figures]:
        """Return the figures of all nodes, those that hurt most first."""
        self._history.note(found)
        return sorted((self._figures(each) for each in found), key=lambda each: each.pain)

    def _figures(self, presence: Presence) -> Figures:
        cpu, memory_mb = self._usage(presence)
        return Figures(presence, self._history.change(presence), cpu, memory_mb)

    def _usage(self, presence: Presence) -> tuple[float | None, float | None]:
        about = presence.description
        if about is None or about.host != self._host:
            return None, None
        if (about.pid, about.started_ns) not in self._measured:
            self._measured.add((about.pid, about.started_ns))
            self._meter.begin(about.pid, about.started_ns / 1e9)
            return None, None  # the first reading of the CPU has nothing to go by
        return self._meter.read(about.pid)


def rows_of(figures: Sequence[Figures]) -> list[Row]:
    """Return the rows of a table; hosts are named if there are several, and who shares a name."""
    hosts = {each.presence.description.host for each in figures if each.presence.description}
    names = Counter(each.presence.name for each in figures)
    rows = (_row(each, len(hosts) > 1, names[each.presence.name] > 1) for each in figures)
    return [
        replace(
            row,
            node=printable(row.node),
            host=printable(row.host),
            dropped=printable(row.dropped),
            message=printable(row.message),
        )
        for row in rows
    ]


def _row(figures: Figures, name_host: bool, name_process: bool) -> Row:
    presence = figures.presence
    about, report = presence.description, presence.report
    if about is None:
        return Row(presence.name, "no answer")
    name = f"{presence.name} ({about.pid})" if name_process else presence.name
    host = about.host if name_host else ""
    if figures.silent_s is not None:
        return Row(name, f"silent for {figures.silent_s:.0f} s", host=host)
    if report is None:
        return Row(name, "starting", host=host)
    return row(
        name,
        report,
        cpu=figures.cpu,
        memory_mb=figures.memory_mb,
        lost=figures.change.lost if figures.change else None,
        host=host,
    )


def record_of(figures: Figures) -> dict[str, Any]:
    """Return the fields of a node for JSON."""
    report, change = figures.presence.report, figures.change
    return {
        **facts(figures.presence),
        "rate_hz": report and report.rate_hz,
        "latency_ms": report and report.latency_ms.to_map(),
        "counters": report and report.counters,
        "lost": change and change.lost,
        "losses": change and change.losses,
        "cpu_percent": figures.cpu,
        "memory_mb": figures.memory_mb,
        "silent_s": figures.silent_s,
    }
