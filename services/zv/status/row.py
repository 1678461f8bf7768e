"""Formats nodes as rows of a table and as lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from zenoh_vision.error_text import printable
from zenoh_vision.health.counter_change import NOT_LOST, losses
from zenoh_vision.messages import Diagnostics
from zv.status.display import View

STATES = ("", "warn", "ERROR", "stale")
"""The displayed state of a node, by the level of its health."""

STYLES = {
    "running": "green",
    "running, no node": "green",
    "running, by hand": "green",
    "ERROR": "bold red",
    "failed": "bold red",
    "finished": "dim",
    "stopped": "dim",
}
TRANSIENT_STYLE = "yellow"

NUMBERS = {
    "rate": "Hz",
    "p50": "ms",
    "p99": "ms",
    "lag": "ms",
    "lost": "%",
    "cpu": "%",
    "memory": "MB",
}
"""Fields of a row that are numbers, and their units."""

TITLES = {"cpu": "CPU %", "memory": "MB"}
"""Titles of columns, where they are not made of field and unit."""

OPTIONAL = ("lag", "lost", "route", "host")
"""Columns that are shown only if at least one row has a value."""


@dataclass(frozen=True, slots=True)
class Row:
    """The texts that are shown for a node; empty if nothing is known yet."""

    node: str
    state: str
    rate: str = ""
    p50: str = ""
    p99: str = ""
    lag: str = ""
    lost: str = ""
    dropped: str = ""
    unwanted: str = ""
    cpu: str = ""
    memory: str = ""
    route: str = ""
    host: str = ""
    message: str = ""


def row_of(
    name: str,
    report: Diagnostics,
    *,
    state: str = "running",
    cpu: float | None = None,
    memory_mb: float | None = None,
    lost: float | None = None,
    host: str = "",
) -> Row:
    """Return the row of a node that sends diagnostics.

    Args:
        name: Name of the node.
        report: Its newest diagnostics.
        state: The state to show while its level is OK.
        cpu: Percent of a core.
        memory_mb: Megabytes.
        lost: Share of its frames that were lost, 0 to 1.
        host: Where it runs; empty to hide it.
    """
    latency = report.latency_ms
    dropped, unwanted = drops(report.counters)
    return Row(
        name,
        STATES[report.level] or state,
        rate=number(report.rate_hz, 1),
        p50=number(latency.p50, 1),
        p99=number(latency.p99, 1),
        lag=number(report.source_lag_ms, 1),
        lost=number(lost and 100 * lost, 1),
        dropped=dropped,
        unwanted=unwanted,
        cpu=number(cpu),
        memory=number(memory_mb),
        route=",".join(sorted(set((report.routes or {}).values()))),
        host=host,
        message="" if report.message == "ok" else report.message,
    )


def number(value: float | None, places: int = 0) -> str:
    """Return a number as text; empty for None."""
    return "" if value is None else f"{value:.{places}f}"


def drops(counters: dict[str, int]) -> tuple[str, str]:
    """Return two texts: the losses by reason, the largest first, and the drops nobody wanted."""
    named = " ".join(f"{reason}={count}" for reason, count in losses(counters).items())
    reason = NOT_LOST[0]
    unwanted = counters.get(f"dropped.{reason}", 0)
    return named, f"{reason}={unwanted}" if unwanted else ""


def view_of(
    rows: Sequence[Row], headline: str = "", records: Sequence[Mapping[str, Any]] = ()
) -> View:
    """Return a view of nodes, with a line above them.

    The last line of the table is short: terminals echo Ctrl-C at its end, and must not wrap there.
    """
    above = [headline] if headline else []
    return View(
        lambda: Group(
            *(Text(printable(line)) for line in above),
            table_of(rows),
            Text("Ctrl-C ends it ", "dim"),
        ),
        [*above, *map(line_of, rows)],
        records,
    )


def table_of(rows: Sequence[Row]) -> Group:
    """Return the table, with the nodes' messages below it."""
    rows = [Row(*map(printable, astuple(row))) for row in rows]
    shown = {name for name in OPTIONAL if any(getattr(row, name) for row in rows)}
    numbers = [name for name in NUMBERS if name not in OPTIONAL or name in shown]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in ("node", "state"):
        table.add_column(name, no_wrap=True)
    for name in numbers:
        title = TITLES.get(name, f"{name} {NUMBERS[name]}")
        table.add_column(title, justify="right", no_wrap=True)
    texts = [name for name in ("route", "host") if name in shown]
    for name in texts:
        table.add_column(name, no_wrap=True)
    table.add_column("dropped", overflow="fold")
    for row in rows:
        dropped = Text(" ").join(filter(None, (Text(row.dropped), Text(row.unwanted, "dim"))))
        table.add_row(
            Text(row.node),
            Text(row.state, STYLES.get(row.state, TRANSIENT_STYLE)),
            *(getattr(row, name) for name in numbers),
            *(Text(getattr(row, name)) for name in texts),
            dropped,
        )
    messages = [Text(f"{row.node}: {row.message}") for row in rows if row.message]
    return Group(table, *messages)


def line_of(row: Row) -> str:
    """Return a node's row as one line of ``name value unit``."""
    words = [f"{row.node:<16} {row.state}"]
    for name, unit in NUMBERS.items():
        if value := getattr(row, name):
            words.append(f"{name} {value} {unit}")
    if row.rate:
        words.append(f"dropped {' '.join(filter(None, (row.dropped, row.unwanted))) or 'none'}")
    if row.route:
        words.append(f"by {row.route}")
    if row.host:
        words.append(f"on {row.host}")
    if row.message:
        words.append(f"({row.message})")
    return "  ".join(words)
