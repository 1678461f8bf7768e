"""What is shown of each node: one row of figures, for the table and for plain lines."""

from __future__ import annotations

from dataclasses import dataclass

import psutil

from common.messages import Diagnostics
from services.up.processes import Child

LEVELS = ("", "warn", "ERROR", "stale")
QUIET = "no_subscriber"
"""Frames that nobody wanted: no loss, so it is named last."""


@dataclass(frozen=True, slots=True)
class Row:
    """A node's figures as text; empty where there is none yet."""

    node: str
    state: str
    rate: str = ""
    p50: str = ""
    p99: str = ""
    dropped: str = ""
    cpu: str = ""
    memory: str = ""
    message: str = ""


class Meter:
    """CPU and memory of processes that come and go."""

    def __init__(self) -> None:
        self._processes: dict[int, psutil.Process] = {}

    def read(self, pid: int | None) -> tuple[str, str]:
        """Return CPU (percent of a core since the last reading) and memory (MB)."""
        if pid is None:
            return "", ""
        try:
            process = self._processes.get(pid)
            if process is None:
                process = self._processes[pid] = psutil.Process(pid)
                process.cpu_percent()  # the first reading has nothing to compare with
                return "", f"{process.memory_info().rss / 1e6:.0f}"
            return f"{process.cpu_percent():.0f}", f"{process.memory_info().rss / 1e6:.0f}"
        except psutil.Error:
            self._processes.pop(pid, None)
            return "", ""


def row_of(child: Child, health: Diagnostics | None, meter: Meter) -> Row:
    """Return a node's row."""
    cpu, memory = meter.read(child.pid)
    if health is None or not child.alive:
        return Row(child.name, child.state, cpu=cpu, memory=memory)
    state = LEVELS[health.level] or child.state
    latency = health.latency_ms
    return Row(
        child.name,
        state,
        rate=f"{health.rate_hz:.1f}",
        p50="" if latency.p50 is None else f"{latency.p50:.1f}",
        p99="" if latency.p99 is None else f"{latency.p99:.1f}",
        dropped=drops(health.counters),
        cpu=cpu,
        memory=memory,
        message="" if health.level == 0 else health.message,
    )


def drops(counters: dict[str, int]) -> str:
    """Return the drops by reason, the largest first."""
    found = {
        name.removeprefix("dropped."): count
        for name, count in counters.items()
        if name.startswith("dropped.") and count
    }
    if counters.get("missed"):
        found["missed"] = counters["missed"]
    ordered = sorted(found.items(), key=lambda item: (item[0] == QUIET, -item[1]))
    return " ".join(f"{reason}={count}" for reason, count in ordered)
