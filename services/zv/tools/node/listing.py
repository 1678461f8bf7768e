"""``zv node list``: lists the running nodes, and with ``--watch`` those that start and end."""

from __future__ import annotations

import threading

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.health.fleet import MAX_NODES, Event, Fleet
from zenoh_vision.health.fleet_monitor import follow
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.transport.connection import Connection
from zv.tools.node.options import ListOptions
from zv.tools.shared.discovery import no_nodes
from zv.tools.shared.nodes import duration, left_out_note, node_facts, running_nodes
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

COLUMNS = ["node", "service", "version", "host", "pid", "uptime", "health"]

ASK_AGAIN_S = 1.0
"""Interval between queries for all nodes, since a second node of a name has no token of its own."""

SETTLE_S = 0.05
"""Nodes that start or end together are shown together."""

FIRST_S = 0.3
"""Existing tokens arrive within this time."""


def run(options: ListOptions, connection: Connection, output: Output) -> None:
    """List the nodes, or print those that start and end.

    Raises:
        ExpectationNotMet: There is no node; the text has the namespaces that have nodes.
    """
    with ToolSession(connection) as session:
        if options.watch:
            watch(session, output)
            return
        found, left_out = running_nodes(session)
        if session.stopping:
            return
        if not found:
            raise ExpectationNotMet(no_nodes(session))
        output.table(COLUMNS, [row(node) for node in found], map(node_facts, found))
        if left_out:
            output.note(left_out_note(left_out))


def row(node: NodeState) -> list[object]:
    """Return a node's cells; most are empty if it does not answer."""
    about = node_facts(node)
    health = about["level"] or ("-" if about["answers"] else "does not answer")
    if about["message"] not in (None, "ok"):
        health += f": {about['message']}"
    return [*(about[name] for name in COLUMNS[:5]), duration(about["uptime_s"]), health]


def watch(session: ToolSession, output: Output) -> None:
    """Print a line for each node that starts or ends, until told to stop."""
    names: set[str] = set()
    changed = threading.Event()

    def on_token(name: str, there: Event) -> None:
        if not there:
            names.discard(name)
        elif len(names) < MAX_NODES:
            names.add(name)
        changed.set()

    follow(session.link, session.namespace, ["token"], on_token)
    fleet = Fleet()
    session.wait(FIRST_S, changed.is_set)
    if not changed.is_set():
        output.note(no_nodes(session))
    while not session.stopping:
        session.wait(SETTLE_S)
        changed.clear()
        came, went = fleet.update(running_nodes(session, names.copy())[0])
        if session.stopping:
            break
        for node in went:
            _print(output, "gone", node)
        for node in came:
            _print(output, "here", node)
        session.wait(ASK_AGAIN_S, changed.is_set)


def _print(output: Output, event: str, node: NodeState) -> None:
    about = node_facts(node)
    place = "does not answer"
    if about["answers"]:
        place = f"{about['service']} {about['version']} on {about['host']}, pid {about['pid']}"
    output.result({"event": event, **about}, f"{event}  {node.name}  {place}")
