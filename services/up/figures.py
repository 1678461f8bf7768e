"""The row of a child of ours: what its process does, and what its node says."""

from __future__ import annotations

import time

from services.figures.board import SILENT_S, Report
from services.figures.meter import Meter
from services.figures.row import Row, number, row
from services.up.processes import Child


def row_of(child: Child, report: Report | None, meter: Meter) -> Row:
    """Return a node's row."""
    cpu, memory_mb = meter.read(child.pid)
    used = {"cpu": number(cpu), "memory": number(memory_mb)}
    if report is None or not child.alive:
        return Row(child.name, child.state, **used)
    silent_s = time.monotonic() - report.arrived_s
    if silent_s > SILENT_S:
        return Row(child.name, f"silent for {silent_s:.0f} s", **used)
    return row(child.name, report.health, state=child.state, cpu=cpu, memory_mb=memory_mb)
