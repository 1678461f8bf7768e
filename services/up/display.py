"""How the rows are shown: a live table on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from services.up.figures import Row

LINE_PERIOD_S = 5.0
TABLE_PERIOD_S = 1.0
COLORS = {"running": "green", "warn": "yellow", "stale": "yellow", "ERROR": "red", "failed": "red"}


class Display(Protocol):
    """Shows rows, and lines that people should see."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...

    def say(self, line: str) -> None:
        """Show a line; from any thread."""

    def show(self, rows: Callable[[], list[Row]]) -> None:
        """Show the rows if it is time; they are made only then."""


class LiveTable:
    """A table that is drawn anew each second; lines go above it.

    Args:
        title: Above the table.
    """

    def __init__(self, title: str) -> None:
        self._console = Console()
        self._title = title
        self._live = Live(
            console=self._console, auto_refresh=False, redirect_stdout=False, transient=False
        )
        self._next_s = 0.0

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._live.stop()

    def say(self, line: str) -> None:
        """Print a line above the table."""
        self._console.print(Text(line))

    def show(self, rows: Callable[[], list[Row]]) -> None:
        """Draw the table, once a second."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + TABLE_PERIOD_S
            self._live.update(drawn(self._title, rows()), refresh=True)


def drawn(title: str, rows: list[Row]) -> Group:
    """Return the table, and what the nodes complain of below it."""
    table = Table(title=title, title_justify="left", expand=False)
    table.add_column("node", no_wrap=True)
    table.add_column("state", no_wrap=True)
    for name in ("rate Hz", "p50 ms", "p99 ms"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("dropped", overflow="fold")
    for name in ("CPU %", "MB"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        state = Text(row.state, style=COLORS.get(row.state, ""))
        table.add_row(row.node, state, row.rate, row.p50, row.p99, row.dropped, row.cpu, row.memory)
    complaints = [Text(f"{row.node}: {row.message}") for row in rows if row.message]
    return Group(table, *complaints)


class PlainLines:
    """A line per node every five seconds, for logs and pipes."""

    def __init__(self) -> None:
        self._next_s = time.monotonic() + LINE_PERIOD_S

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Nothing to give back."""

    def say(self, line: str) -> None:
        """Print a line to standard error."""
        print(line, file=sys.stderr, flush=True)

    def show(self, rows: Callable[[], list[Row]]) -> None:
        """Print the lines, every five seconds."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s += LINE_PERIOD_S
            for row in rows():
                print(line_of(row), flush=True)


def line_of(row: Row) -> str:
    """Return a node's figures as one line of ``name=value``."""
    words = [f"{row.node:<16} {row.state}"]
    for name, value, unit in (
        ("rate", row.rate, " Hz"),
        ("p50", row.p50, " ms"),
        ("p99", row.p99, " ms"),
        ("cpu", row.cpu, " %"),
        ("memory", row.memory, " MB"),
    ):
        if value:
            words.append(f"{name} {value}{unit}")
    words.append(f"dropped {row.dropped or 'none'}")
    if row.message:
        words.append(f"({row.message})")
    return "  ".join(words)
