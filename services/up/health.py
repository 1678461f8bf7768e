"""What `zv up` tells a health check of its nodes."""

from __future__ import annotations

import time

from common.diagnostics import ERROR
from services.figures.board import SILENT_S, Report
from services.up.processes import Child


def trouble_of(child: Child, report: Report | None) -> str:
    """Return why a node does no work; nothing while it does, starts, or has finished."""
    if child.state in ("starting", "finished"):
        return ""
    if not child.alive:
        return f"{child.name} {child.state}"
    if report is None:
        return ""  # the router says nothing of itself
    silent_s = time.monotonic() - report.arrived_s
    if silent_s > SILENT_S:
        return f"{child.name} silent for {silent_s:.0f} s"
    health = report.health
    return f"{child.name}: {health.message}" if health.level == ERROR else ""
