"""What is known of a node, as fields for JSON and as words for people."""

from __future__ import annotations

from typing import Any

from common.diagnostics import ERROR, OK, STALE, WARN
from services.tools.nodes import Presence

LEVEL_NAMES = {OK: "OK", WARN: "WARN", ERROR: "ERROR", STALE: "STALE"}
"""As diagnostic_msgs/DiagnosticStatus has them."""


def facts(presence: Presence) -> dict[str, Any]:
    """Return what a node says of itself; only its name if it does not answer."""
    about = presence.description
    report = presence.report
    return {
        "node": presence.name,
        "answers": about is not None,
        "service": about and about.service,
        "cameras": about and list(about.cameras),
        "version": about and about.version,
        "host": about and about.host,
        "pid": about and about.pid,
        "started_ns": about and about.started_ns,
        "uptime_s": presence.uptime_s,
        "publishes": about and list(about.publishes),
        "subscribes": about and list(about.subscribes),
        "level": report and LEVEL_NAMES[report.level],
        "message": report and report.message,
    }


def duration(seconds: float | None) -> str:
    """Return a time in its two largest units: ``3 min 12 s``, ``2 d 5 h``."""
    if seconds is None:
        return "-"
    whole = int(seconds)
    for size, unit, smaller, smaller_unit in (
        (86400, "d", 3600, "h"),
        (3600, "h", 60, "min"),
        (60, "min", 1, "s"),
    ):
        if whole >= size:
            return f"{whole // size} {unit} {whole % size // smaller} {smaller_unit}"
    return f"{whole} s"
