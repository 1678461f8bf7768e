"""The output of a tool: results to standard output, everything else to standard error."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

from zenoh_vision.error_text import printable
from zv.status.display import Display, View, display_on, json_line

if TYPE_CHECKING:  # rich takes a tenth of a second to import, which most output does not need
    from rich.console import Console, RenderableType

WIDE = 4096
"""Width without a terminal, so that lines are neither cut nor wrapped."""


UNREAD_MS = 300
"""How long a tool that is told to stop waits for the reader of its output."""


def discard_unread_output() -> None:
    """Discard further output if nobody reads it, so that what waits for the reader can end.

    In a signal handler: what was interrupted while it wrote goes on writing, but to nowhere.
    """
    output = select.poll()
    output.register(1, select.POLLOUT)
    if not output.poll(UNREAD_MS):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


class Output:
    """A tool's output, as JSON if ``--json`` was given."""

    def __init__(self, *, as_json: bool = False) -> None:
        self.as_json = as_json

    def line(self, text: str = "") -> None:
        """Print one line of a result; line ends within it are escaped."""
        print(printable(text), flush=True)

    def record(self, fields: Mapping[str, Any]) -> None:
        """Print one JSON object on one line."""
        print(json_line(fields), flush=True)

    def result(self, fields: Mapping[str, Any], *lines: str) -> None:
        """Print one result: with ``--json`` its fields, else its lines of text."""
        if self.as_json:
            self.record(fields)
        else:
            print("\n".join(map(printable, lines)), flush=True)

    def table(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[object]],
        records: Iterable[Mapping[str, Any]] | None = None,
    ) -> None:
        """Print a table; with ``--json`` the records instead, if given."""
        if records is None or not self.as_json:
            self.show(table(columns, rows))
            return
        for record in records:
            self.record(record)

    def show(self, renderable: RenderableType) -> None:
        """Print anything that rich knows how to draw."""
        self.console.print(renderable, soft_wrap=not self.console.is_terminal)

    def note(self, text: str) -> None:
        """Print a line that is not a result, to standard error."""
        with suppress(OSError):  # without a reader of the log, the program continues
            print(f"zv: {printable(text)}", file=sys.stderr, flush=True)

    def display(self) -> Display:
        """Return the display for a table that changes."""
        return display_on(self.console, as_json=self.as_json)

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


def view_of(
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    lines: Sequence[str],
    records: Sequence[Mapping[str, Any]],
) -> View:
    """Return a view of a table; ``columns`` and ``rows`` as for ``table``."""
    return View(lambda: table(columns, rows), lines, records)


def table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> RenderableType:
    """Return a table with numbers right-aligned, None and NaN as ``-``.

    Args:
        columns: Titles.
        rows: Cells: text, numbers with as many places as they were rounded to, or rich's ``Text``
            for colours.
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
