"""Where a tool's words go: results to standard output, everything else to standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:  # rich takes a tenth of a second to import, which most output does not need
    from rich.console import Console, RenderableType
    from rich.live import Live

WIDE = 4096
"""Columns where there is no terminal: nothing is cut or broken there."""


class Output:
    """A tool's output.

    Args:
        as_json: ``--json`` was given.
    """

    def __init__(self, *, as_json: bool = False) -> None:
        self.as_json = as_json

    def line(self, text: str = "") -> None:
        """Print one line of a result."""
        print(printable(text), flush=True)

    def record(self, fields: Mapping[str, Any]) -> None:
        """Print one JSON object on a line of its own."""
        print(json.dumps(fields, allow_nan=False), flush=True)

    def table(self, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Print a table, numbers to the right; None and NaN are shown as ``-``."""
        self.show(table(columns, rows))

    def show(self, renderable: RenderableType) -> None:
        """Print anything that rich knows how to draw."""
        self.console.print(renderable, soft_wrap=not self.console.is_terminal)

    def note(self, text: str) -> None:
        """Say something that is not a result, on standard error."""
        with suppress(OSError):  # a log that nobody reads any more is no reason to end
            print(f"zv: {text}", file=sys.stderr, flush=True)

    @contextmanager
    def board(self) -> Iterator[Board]:
        """Yield a place for a table that changes: drawn anew on a terminal, lines elsewhere."""
        if self.as_json or not self.console.is_terminal:
            yield Board(self, None)
            return
        from rich.live import Live

        with Live(console=self.console, auto_refresh=False, redirect_stderr=False) as live:
            yield Board(self, live)

    @cached_property
    def console(self) -> Console:
        """Standard output: colours on a terminal only, and not with ``NO_COLOR``."""
        from rich.console import Console

        class PlainConsole(Console):
            def on_broken_pipe(self) -> NoReturn:
                raise BrokenPipeError  # rich would end the program with status 1

        console = PlainConsole(highlight=False, markup=False, emoji=False)
        if not console.is_terminal:
            console.width = WIDE
        return console


class Board:
    """A table that is shown again and again.

    Args:
        output: Where to.
        live: What draws it in place; None to print lines.
    """

    def __init__(self, output: Output, live: Live | None) -> None:
        self._output = output
        self._live = live

    def show(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[object]],
        lines: Sequence[str],
        records: Sequence[Mapping[str, Any]],
    ) -> None:
        """Show the newest figures, in the form that fits: table, lines, or JSON."""
        if self._output.as_json:
            for record in records:
                self._output.record(record)
        elif self._live is None:
            for line in lines:
                self._output.line(line)
        else:
            self._live.update(table(columns, rows), refresh=True)


def printable(text: str) -> str:
    """Return a text from the network without what would steer the terminal."""
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or letter in "\n\t" else repr(letter)[1:-1]
        for letter in text
    )


def table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> RenderableType:
    """Return a table in the manner of this project.

    Args:
        columns: Titles.
        rows: Text as it stands; numbers with as many places as they were rounded to; rich's
            ``Text`` for what has a colour.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    drawn = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for index, title in enumerate(columns):
        numbers = [row[index] for row in rows if row[index] is not None]
        right = bool(numbers) and all(isinstance(cell, (int, float)) for cell in numbers)
        drawn.add_column(
            title, justify="right" if right else "left", no_wrap=right, overflow="fold"
        )
    for row in rows:
        cells = ("-" if cell is None or cell != cell else cell for cell in row)
        drawn.add_row(
            *(cell if isinstance(cell, Text) else Text(printable(str(cell))) for cell in cells)
        )
    return drawn
