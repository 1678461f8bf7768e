"""``zv top``: queries all nodes periodically, and shows them."""

from __future__ import annotations

import time
from collections import Counter

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.transport.connection import Connection
from zv.status.display import LiveTable
from zv.status.row import STATES, table_of, view_of
from zv.tools.shared.discovery import no_nodes
from zv.tools.shared.nodes import left_out_note, running_nodes
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession
from zv.tools.top.options import TopOptions
from zv.tools.top.ranking import Ranked, Ranking, record_of, rows_of

PERIOD_S = 1.0
LINES_PERIOD_S = 5.0
TWO_REPORTS_S = 1.1
"""Every node sends its diagnostics, which are due once a second, within this time."""


def run(options: TopOptions, connection: Connection, output: Output) -> None:
    """Show all nodes, once or until told to stop.

    Raises:
        ExpectationNotMet: There is no node, with ``--once``.
    """
    with ToolSession(connection) as session:
        if options.once:
            show_once(session, output)
        else:
            watch(session, output, options.every)


def show_once(session: ToolSession, output: Output) -> None:
    """Query twice, since losses are a difference of two reports, and show the second state."""
    ranking = Ranking()
    ranked = ranking.update(running_nodes(session)[0])
    left_out = 0
    if ranked:
        session.wait(TWO_REPORTS_S)
        found, left_out = running_nodes(session)
        ranked = ranking.update(found)
    if session.stopping:
        return
    if not ranked:
        raise ExpectationNotMet(no_nodes(session))
    if output.as_json:
        for each in ranked:
            output.record(record_of(each))
    else:
        output.show(table_of(rows_of(ranked)))
    if left_out:
        output.note(left_out_note(left_out))


def watch(session: ToolSession, output: Output, every_s: float | None) -> None:
    """Show the nodes periodically; in JSON, equal ``at_ns`` are of one snapshot."""
    ranking = Ranking()
    with output.display() as display:
        often = output.as_json or isinstance(display, LiveTable)
        period_s = every_s or (PERIOD_S if often else LINES_PERIOD_S)
        while not session.stopping:
            began_s, at_ns = time.monotonic(), time.time_ns()
            found, left_out = running_nodes(session)
            ranked = ranking.update(found)
            if session.stopping:
                break
            records = [{"at_ns": at_ns, **record_of(each)} for each in ranked]
            above = headline(session, ranked)
            if left_out:
                above = f"{above}; {left_out_note(left_out)}"
            display.show(view_of(rows_of(ranked), above, records))
            session.wait(period_s - (time.monotonic() - began_s))


def headline(session: ToolSession, ranked: list[Ranked]) -> str:
    """Return the line above the table: the number of nodes, and of those in each bad state."""
    if not session.connected:
        return f"no router at {session.connection.connect}, waiting for it"
    if not ranked:
        return f"no node in namespace {session.namespace}"
    reports = (each.node.report for each in ranked if each.node.answered)
    states = Counter(STATES[report.level] for report in reports if report and report.level)
    words = [f"{len(ranked)} node{'s' if len(ranked) > 1 else ''}"]
    words += [f"{count} {state}" for state, count in states.items()]
    return f"{session.namespace} at {session.connection.connect}: {', '.join(words)}"
