"""One row of figures for each node, for the table and for plain lines."""

from __future__ import annotations

from dataclasses import dataclass

from common.messages import Diagnostics
from services.figures.change import UNWANTED, losses

LEVELS = ("", "warn", "ERROR", "stale")


@dataclass(frozen=True, slots=True)
class Row:
    """A node's figures as text; empty where there is none yet."""

    node: str
    state: str
    rate: str = ""
    p50: str = ""
    p99: str = ""
    lost: str = ""
    dropped: str = ""
    unwanted: str = ""
    cpu: str = ""
    memory: str = ""
    host: str = ""
    message: str = ""


def row(
    node: str,
    health: Diagnostics,
    *,
    state: str = "running",
    cpu: str = "",
    memory: str = "",
    lost: str = "",
    host: str = "",
) -> Row:
    """Return the row of a node that reports.

    Args:
        node: Its name.
        health: Its newest report.
        state: What stands there when it has nothing to complain of.
        cpu: Percent of a core.
        memory: Megabytes.
        lost: Percent of its frames.
        host: Where it runs.
    """
    latency = health.latency_ms
    dropped, unwanted = drops(health.counters)
    return Row(
        node,
        LEVELS[health.level] or state,
        rate=f"{health.rate_hz:.1f}",
        p50="" if latency.p50 is None else f"{latency.p50:.1f}",
        p99="" if latency.p99 is None else f"{latency.p99:.1f}",
        lost=lost,
        dropped=dropped,
        unwanted=unwanted,
        cpu=cpu,
        memory=memory,
        host=host,
        message="" if health.message == "ok" else health.message,
    )


def drops(counters: dict[str, int]) -> tuple[str, str]:
    """Return the drops by reason, the largest first; and apart what nobody wanted."""
    named = " ".join(f"{reason}={count}" for reason, count in losses(counters).items())
    unwanted = counters.get(f"dropped.{UNWANTED}", 0)
    return named, f"{UNWANTED}={unwanted}" if unwanted else ""
