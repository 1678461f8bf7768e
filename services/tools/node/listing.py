"""``zv node list``: the nodes that run."""

from __future__ import annotations

from common.connection import Connection
from common.errors import ExpectationNotMet
from services.tools.facts import duration, facts
from services.tools.namespaces import nobody_here
from services.tools.node.options import ListOptions
from services.tools.node.watching import watch
from services.tools.nodes import Presence, present
from services.tools.output import Output
from services.tools.session import ToolSession

COLUMNS = ["node", "service", "version", "host", "pid", "uptime", "health"]


def run(options: ListOptions, connection: Connection, output: Output) -> None:
    """List the nodes, or say who comes and goes.

    Raises:
        ExpectationNotMet: There is no node; names the namespaces that have some.
    """
    with ToolSession(connection) as session:
        if options.watch:
            watch(session, output)
            return
        found = present(session)
        if session.stopping:
            return
        if not found:
            raise ExpectationNotMet(nobody_here(session))
        if output.as_json:
            for each in found:
                output.record(facts(each))
        else:
            output.table(COLUMNS, [row(each) for each in found])


def row(presence: Presence) -> list[object]:
    """Return a node's cells; one that does not answer has little to show."""
    about = facts(presence)
    health = about["level"] or ("-" if about["answers"] else "does not answer")
    if about["message"] not in (None, "ok"):
        health += f": {about['message']}"
    uptime = duration(about["uptime_s"])
    return [*(about[name] for name in COLUMNS[:5]), uptime, health]
