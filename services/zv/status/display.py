"""Shows a table that changes: drawn in place on a terminal, as lines or JSON elsewhere."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from zenoh_vision.error_text import printable

if TYPE_CHECKING:  # rich takes a tenth of a second to import, which only a live table needs
    from rich.console import Console, RenderableType


TABLE_PERIOD_S = 1.0


def json_line(fields: Mapping[str, Any]) -> str:
    """Return a JSON object on one line, in printable ASCII."""
    return json.dumps(fields, allow_nan=False).replace("\x7f", "\\u007f")  # DEL


@dataclass(frozen=True, slots=True)
class View:
    """The content of a table at one moment: drawn on a terminal, as plain lines, for JSON."""

    table: Callable[[], RenderableType]
    lines: Sequence[str]
    records: Sequence[Mapping[str, Any]] = ()


def display_on(
    console: Console, *, as_json: bool = False, plain: bool = False, lines_period_s: float = 0.0
) -> Display:
    """Return the display that suits a console; ``plain`` prints lines on a terminal too."""
    # A terminal that cannot move its cursor gets lines.
    if as_json or plain or not console.is_terminal or console.is_dumb_terminal:
        return Display(as_json=as_json, period_s=lines_period_s)
    return LiveTable(console)


class Display:
    """Prints plain lines, or JSON with one object a line, for logs and pipes.

    Args:
        as_json: Print JSON rather than lines.
        period_s: Interval between lines, also before the first one.
    """

    def __init__(self, *, as_json: bool = False, period_s: float = 0.0) -> None:
        self._as_json = as_json
        self._period_s = period_s
        self._next_s = time.monotonic() + period_s

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Restore the terminal."""

    def due(self) -> bool:
        """Tell whether the next view is due; if so, begin the next period."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            return False
        self._next_s = now_s + self._period_s
        return True

    def show(self, view: View) -> None:
        """Show a view now."""
        for line in map(json_line, view.records) if self._as_json else view.lines:
            self.announce(line)

    def announce(self, line: str) -> None:
        """Print a line of a result, to standard output."""
        print(printable(line), flush=True)

    def say(self, line: str) -> None:
        """Print a line about an event, to standard error; from any thread."""
        with suppress(OSError):  # without a reader of the log, the program continues
            print(printable(line), file=sys.stderr, flush=True)


class LiveTable(Display):
    """Draws a table in place, once a second at most; other lines go above it."""

    def __init__(self, console: Console) -> None:
        from rich.live import Live

        super().__init__(period_s=TABLE_PERIOD_S)
        self._next_s = 0.0
        self._console = console
        self._live = Live(
            console=console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()

    def show(self, view: View) -> None:
        """Draw a view now."""
        self._live.update(view.table(), refresh=True)

    def announce(self, line: str) -> None:
        """Print a line above the table."""
        from rich.text import Text

        self._console.print(Text(printable(line)), soft_wrap=True)

    def say(self, line: str) -> None:
        """Print a line above the table, or to standard error if that is redirected."""
        if sys.stderr.isatty():
            self.announce(line)
        else:
            super().say(line)
