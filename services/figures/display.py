"""How the rows are shown: a live table on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Protocol, Self

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from services.figures.row import Row

LINE_PERIOD_S = 5.0
TABLE_PERIOD_S = 1.0
STYLES = {
    "running": "green",
    "ERROR": "bold red",
    "failed": "bold red",
    "finished": "dim",
    "stopped": "dim",
}
TRANSIENT_STYLE = "yellow"

NUMBERS = {"rate": "Hz", "p50": "ms", "p99": "ms", "lost": "%", "cpu": "%", "memory": "MB"}
"""Fields of a row that are numbers, and their units."""

TITLES = {"cpu": "CPU %", "memory": "MB"}
"""Columns that are called otherwise than field and unit."""

WHEN_KNOWN = ("lost", "host")
"""Columns that are there only when a row has something to say in them."""


class Display(Protocol):
    """Shows rows, and lines that people should see."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...

    def announce(self, line: str) -> None:
        """Show a line that was asked for, on standard output."""

    def say(self, line: str) -> None:
        """Show a line of what happens, on standard error; from any thread."""

    def show(self, rows: Callable[[], list[Row]], headline: str = "") -> None:
        """Show the rows, and a line over them, if it is time; they are made only then."""


class LiveTable:
    """A table that is drawn anew again and again; lines go above it.

    Args:
        console: Where it is drawn.
        period_s: How often; 0 whenever there is something to show.
    """

    def __init__(self, console: Console, period_s: float = TABLE_PERIOD_S) -> None:
        self._console = console
        self._period_s = period_s
        self._live = Live(
            console=self._console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
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

    def announce(self, line: str) -> None:
        """Print a line above the table."""
        self._console.print(Text(line), soft_wrap=True)

    def say(self, line: str) -> None:
        """Print a line above the table, or to standard error if that leads elsewhere."""
        if sys.stderr.isatty():
            self.announce(line)
        else:
            _to_stderr(line)

    def show(self, rows: Callable[[], list[Row]], headline: str = "") -> None:
        """Draw the table if it is time."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + self._period_s
            self._live.update(drawn(rows(), headline), refresh=True)


def drawn(rows: list[Row], headline: str = "") -> Group:
    """Return the table with its headline, what the nodes have to say, and how to end it.

    The last line is short: terminals echo Ctrl-C at its end, and must not wrap there.
    """
    above = [Text(headline)] if headline else []
    return Group(*above, table_of(rows), Text("Ctrl-C ends it ", "dim"))


def table_of(rows: list[Row]) -> Group:
    """Return the table, and below it what the nodes have to say."""
    shown = {name for name in WHEN_KNOWN if any(getattr(row, name) for row in rows)}
    numbers = [name for name in NUMBERS if name not in WHEN_KNOWN or name in shown]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in ("node", "state"):
        table.add_column(name, no_wrap=True)
    for name in numbers:
        title = TITLES.get(name, f"{name} {NUMBERS[name]}")
        table.add_column(title, justify="right", no_wrap=True)
    if "host" in shown:
        table.add_column("host", no_wrap=True)
    table.add_column("dropped", overflow="fold")
    for row in rows:
        dropped = Text(" ").join(
            Text(words, style)
            for words, style in ((row.dropped, ""), (row.unwanted, "dim"))
            if words
        )
        table.add_row(
            Text(row.node),
            Text(row.state, STYLES.get(row.state, TRANSIENT_STYLE)),
            *(getattr(row, name) for name in numbers),
            *([Text(row.host)] if "host" in shown else []),
            dropped,
        )
    messages = [Text(f"{row.node}: {row.message}") for row in rows if row.message]
    return Group(table, *messages)


class PlainLines:
    """A line per node now and then, for logs and pipes.

    Args:
        period_s: How often, the first time after so long; 0 whenever there is something to show.
    """

    def __init__(self, period_s: float = LINE_PERIOD_S) -> None:
        self._period_s = period_s
        self._next_s = time.monotonic() + period_s

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Nothing to give back."""

    def announce(self, line: str) -> None:
        """Print a line to standard output."""
        print(line, flush=True)

    def say(self, line: str) -> None:
        """Print a line to standard error."""
        _to_stderr(line)

    def show(self, rows: Callable[[], list[Row]], headline: str = "") -> None:
        """Print the lines if it is time."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + self._period_s
            for line in (*([headline] if headline else []), *map(line_of, rows())):
                self.announce(line)


def line_of(row: Row) -> str:
    """Return a node's figures as one line of ``name value unit``."""
    words = [f"{row.node:<16} {row.state}"]
    for name, unit in NUMBERS.items():
        if value := getattr(row, name):
            words.append(f"{name} {value} {unit}")
    if row.rate:
        words.append(f"dropped {' '.join(filter(None, (row.dropped, row.unwanted))) or 'none'}")
    if row.host:
        words.append(f"on {row.host}")
    if row.message:
        words.append(f"({row.message})")
    return "  ".join(words)


def _to_stderr(line: str) -> None:
    with suppress(OSError):  # a log that nobody reads any more is no reason to end
        print(line, file=sys.stderr, flush=True)
