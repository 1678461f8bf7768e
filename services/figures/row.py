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
    cpu: float | None = None,
    memory_mb: float | None = None,
    lost: float | None = None,
    host: str = "",
) -> Row:
    """Return the row of a node that reports.

    Args:
        node: Its name.
        health: Its newest report.
        state: What stands there when it has nothing to complain of.
        cpu: Percent of a core.
        memory_mb: Megabytes.
        lost: Share of its frames, 0 to 1.
        host: Where it runs.
    """
    latency = health.latency_ms
    dropped, unwanted = drops(health.counters)
    return Row(
        node,
        LEVELS[health.level] or state,
        rate=number(health.rate_hz, 1),
        p50=number(latency.p50, 1),
        p99=number(latency.p99, 1),
        lost=number(lost and 100 * lost, 1),
        dropped=dropped,
        unwanted=unwanted,
        cpu=number(cpu),
        memory=number(memory_mb),
        host=host,
        message="" if health.message == "ok" else health.message,
    )


def number(value: float | None, places: int = 0) -> str:
    """Return a number as text, nothing for none."""
    return "" if value is None else f"{value:.{places}f}"


def drops(counters: dict[str, int]) -> tuple[str, str]:
    """Return the drops by reason, the largest first; and apart what nobody wanted."""
    named = " ".join(f"{reason}={count}" for reason, count in losses(counters).items())
    unwanted = counters.get(f"dropped.{UNWANTED}", 0)
    return named, f"{UNWANTED}={unwanted}" if unwanted else ""
