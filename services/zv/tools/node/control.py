"""``zv node stop``, ``start`` and ``restart``: changes a node that ``zv up`` runs."""

from __future__ import annotations

from functools import partial
from typing import Final

import msgpack

from zenoh_vision import keys
from zenoh_vision.error_text import printable
from zenoh_vision.errors import ExpectationNotMet, PayloadError, ToldToStop
from zenoh_vision.keys import LaunchVerb
from zenoh_vision.message_codec import unpack
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.query import Reply
from zv.tools.node.options import ControlOptions
from zv.tools.shared.discovery import nothing_matches
from zv.tools.shared.nodes import place, running_nodes
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

ANSWER_S: Final = 3610.0
"""Longer than the longest time that a launch file may give a node to end; Ctrl-C ends the wait."""


def run(verb: LaunchVerb, options: ControlOptions, connection: Connection, output: Output) -> None:
    """Print the state of the node afterwards.

    Raises:
        ExpectationNotMet: No ``zv up`` runs the node, or the credentials do not allow it.
    """
    with ToolSession(connection) as session:
        key = keys.launch_key(session.namespace, options.node)
        session.require("query", key)
        if not session.ask(key):
            raise _not_run(session, options.node)
        replies = session.ask(key, msgpack.packb(verb), timeout_s=ANSWER_S)
        if session.stopping:
            raise ToldToStop("told to stop before the node had ended")
    states = [state for reply in replies if (state := _state(reply))]
    if not states:
        raise ExpectationNotMet(f"{options.node}: the zv up that runs it does not answer")
    for state in states:
        output.result({"node": options.node, "state": state}, f"{options.node}: {state}")


def _state(reply: Reply) -> str:
    """Return the state in a reply; empty if there is none."""
    if reply.ok is None:
        return ""
    try:
        found = unpack(reply.ok.payload.to_bytes())
    except PayloadError:
        return ""
    return printable(found[:100]) if isinstance(found, str) else ""


def _not_run(session: ToolSession, node: str) -> ExpectationNotMet | ToldToStop:
    """Return the error for a node that no ``zv up`` runs."""
    nodes, _ = running_nodes(session)
    known = [reply.name for reply in session.ask(keys.launch_key(session.namespace, "*"))]
    if session.stopping:
        return ToldToStop("told to stop while waiting for an answer")
    for each in nodes:
        if each.name == node and each.description is not None:
            where = place(each.description)
            return ExpectationNotMet(
                f"{node} was started by hand ({where}), not by zv up: end it there, as by Ctrl-C"
            )
    if not known:
        return ExpectationNotMet(f"no zv up runs {node}, nor any other node")
    return ExpectationNotMet(nothing_matches(node, known, kind="node of zv up"))


stop = partial(run, "stop")
start = partial(run, "start")
restart = partial(run, "restart")
