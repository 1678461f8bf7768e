"""``zv topic list``: the keys there are, and what flows on them."""

from __future__ import annotations

from common.connection import Connection
from common.errors import ExpectationNotMet
from services.tools.output import Output
from services.tools.session import ToolSession, key_expression
from services.tools.survey import survey
from services.tools.topic.observing import observe
from services.tools.topic.options import ListOptions

COLUMNS = ("key", "type", "encoding", "publishers", "subscribers", "rate Hz")


def run(options: ListOptions, connection: Connection, output: Output) -> None:
    """List once, or again and again.

    Raises:
        ExpectationNotMet: Nothing matches.
    """
    pattern = key_expression(options.key or f"{connection.namespace}/**")
    with ToolSession(connection) as session:
        if options.watch:
            _watch(options, pattern, session, output)
            return
        found = survey(session)
        entries = observe(session, found, pattern, options.window, everything=options.all_)
        entries = [each for each in entries if each.state == "flowing" or not options.flowing]
        if session.stopping:
            return
        if not entries:
            raise ExpectationNotMet(found.nothing_on(pattern))
        if output.as_json:
            for entry in entries:
                output.record(entry.record())
        else:
            output.table(COLUMNS, [entry.row() for entry in entries])
        if not found.answered:
            output.note("the router does not say who subscribes: streams on demand were left alone")


def _watch(options: ListOptions, pattern: str, session: ToolSession, output: Output) -> None:
    with output.board() as board:
        while not session.stopping:
            entries = observe(
                session, survey(session), pattern, options.window, everything=options.all_
            )
            entries = [each for each in entries if each.state == "flowing" or not options.flowing]
            if not session.stopping:
                board.show(
                    COLUMNS,
                    [entry.row() for entry in entries],
                    [entry.line() for entry in entries],
                    [entry.record() for entry in entries],
                )
