"""What is shown of each node: one row of figures, for the table and for plain lines."""

from __future__ import annotations

import time
from dataclasses import dataclass

import psutil

from services.up.health import SILENT_S, Report
from services.up.processes import Child

LEVELS = ("", "warn", "ERROR", "stale")
UNWANTED = "no_subscriber"
"""Frames that nobody wanted are no loss, so they are shown last and apart."""


@dataclass(frozen=True, slots=True)
class Row:
    """A node's figures as text; empty where there is none yet."""

    node: str
    state: str
    rate: str = ""
    p50: str = ""
    p99: str = ""
    dropped: str = ""
    unwanted: str = ""
    cpu: str = ""
    memory: str = ""
    message: str = ""


class Meter:
    """CPU and memory of processes that come and go."""

    def __init__(self) -> None:
        self._processes: dict[int, psutil.Process] = {}

    def begin(self, pid: int) -> None:
        """Start to measure a process, so that its first reading has something to go by."""
        try:
            process = psutil.Process(pid)
            process.cpu_percent()
        except psutil.Error:
            return  # it has ended already
        self._processes[pid] = process

    def read(self, pid: int | None) -> tuple[str, str]:
        """Return CPU (percent of a core since the last reading) and memory (MB)."""
        process = None if pid is None else self._processes.get(pid)
        if process is None:
            return "", ""
        try:
            return f"{process.cpu_percent():.0f}", f"{process.memory_info().rss / 1e6:.0f}"
        except psutil.Error:
            self._processes.pop(process.pid, None)
            return "", ""


def row_of(child: Child, report: Report | None, meter: Meter) -> Row:
    """Return a node's row."""
    cpu, memory = meter.read(child.pid)
    if report is None or not child.alive:
        return Row(child.name, child.state, cpu=cpu, memory=memory)
    silent_s = time.monotonic() - report.arrived_s
    if silent_s > SILENT_S:
        return Row(child.name, f"silent for {silent_s:.0f} s", cpu=cpu, memory=memory)
    health = report.health
    latency = health.latency_ms
    dropped, unwanted = drops(health.counters)
    return Row(
        child.name,
        LEVELS[health.level] or child.state,
        rate=f"{health.rate_hz:.1f}",
        p50="" if latency.p50 is None else f"{latency.p50:.1f}",
        p99="" if latency.p99 is None else f"{latency.p99:.1f}",
        dropped=dropped,
        unwanted=unwanted,
        cpu=cpu,
        memory=memory,
        message="" if health.message == "ok" else health.message,
    )


def drops(counters: dict[str, int]) -> tuple[str, str]:
    """Return the drops by reason, the largest first; and apart what nobody wanted."""
    found = {
        name.removeprefix("dropped."): count
        for name, count in counters.items()
        if name.startswith("dropped.") and count
    }
    if counters.get("missed"):
        found["missed"] = counters["missed"]
    unwanted = found.pop(UNWANTED, 0)
    ordered = sorted(found.items(), key=lambda item: -item[1])
    named = " ".join(f"{reason}={count}" for reason, count in ordered)
    return named, f"{UNWANTED}={unwanted}" if unwanted else ""
