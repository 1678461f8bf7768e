"""``zv top``: look again and again, and show it in the form that fits."""

from __future__ import annotations

import time
from collections import Counter

from common.connection import Connection
from common.errors import ExpectationNotMet
from services.figures.display import Display, LiveTable, PlainLines, table_of
from services.figures.row import LEVELS
from services.tools.namespaces import nobody_here
from services.tools.nodes import present
from services.tools.output import Output
from services.tools.session import ToolSession
from services.tools.top.options import TopOptions
from services.tools.top.ranking import Figures, Observer, record_of, rows_of

LOOK_S = 1.0
LINES_S = 5.0
TWO_REPORTS_S = 1.1
"""Health comes once a second: after so long every node has reported once more."""


def run(options: TopOptions, connection: Connection, output: Output) -> None:
    """Show the figures of all nodes, once or until told to stop.

    Raises:
        ExpectationNotMet: With ``--once``: there is no node.
    """
    with ToolSession(connection) as session:
        if options.once:
            show_once(session, output)
        elif output.as_json:
            records(session, output, options.every or LOOK_S)
        else:
            on_terminal = output.console.is_terminal and not output.console.is_dumb_terminal
            every_s = options.every or (LOOK_S if on_terminal else LINES_S)
            with LiveTable(output.console, 0.0) if on_terminal else PlainLines(0.0) as display:
                watch(session, display, every_s)


def show_once(session: ToolSession, output: Output) -> None:
    """Look twice, so that losses are those of now, and show the second."""
    observer = Observer()
    figures = observer.look(present(session))
    if figures:
        session.wait(TWO_REPORTS_S)
        figures = observer.look(present(session))
    if session.stopping:
        return
    if not figures:
        raise ExpectationNotMet(nobody_here(session))
    if output.as_json:
        for each in figures:
            output.record(record_of(each))
    else:
        output.show(table_of(rows_of(figures)))


def records(session: ToolSession, output: Output, every_s: float) -> None:
    """Print a line of JSON for each node at each look; equal ``at_ns`` are of one look."""
    observer = Observer()
    while not session.stopping:
        at_ns = time.time_ns()
        figures = observer.look(present(session))
        if not session.stopping:
            for each in figures:
                output.record({"at_ns": at_ns, **record_of(each)})
        session.wait(every_s - (time.time_ns() - at_ns) / 1e9)


def watch(session: ToolSession, display: Display, every_s: float) -> None:
    """Show the figures at each look."""
    observer = Observer()
    while not session.stopping:
        began_s = time.monotonic()
        figures = observer.look(present(session))
        if session.stopping:
            break
        display.show(lambda figures=figures: rows_of(figures), headline(session, figures))  # type: ignore[misc]
        session.wait(every_s - (time.monotonic() - began_s))


def headline(session: ToolSession, figures: list[Figures]) -> str:
    """Return what stands over the figures: how many nodes there are, and how they do."""
    if not session.connected:
        return f"no router at {session.connection.connect}, waiting for it"
    if not figures:
        return f"no node in namespace {session.namespace}"
    reports = (each.presence.report for each in figures)
    levels = Counter(LEVELS[report.level] for report in reports if report and report.level)
    words = [f"{len(figures)} node{'s' if len(figures) > 1 else ''}"]
    words += [f"{count} {level}" for level, count in levels.items()]
    return f"{session.namespace} at {session.connection.connect}: {', '.join(words)}"
