"""Finds the running nodes by their liveliness tokens, and queries their descriptions.

Two nodes with the same name share one token, so nodes are distinguished by the sessions that
answer queries.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import Any

from zenoh_vision import keys
from zenoh_vision.error_text import joined
from zenoh_vision.errors import ExpectationNotMet, PayloadError, ToldToStop, VisionError
from zenoh_vision.health.fleet import MAX_NODES, bounded
from zenoh_vision.health.message_limits import MAX_NAME, check
from zenoh_vision.health.node_state import ClockOffset, NodeState
from zenoh_vision.messages import Diagnostics, Level, NodeDescription, Parameter
from zenoh_vision.transport.query import Query, Reply, messages_in
from zv.tools.shared.discovery import nothing_matches, tokens_query
from zv.tools.shared.session import ToolSession

NO_ANSWER = "has a liveliness token but does not answer"
DESCRIBED = (
    *("service", "pipeline", "cameras", "version", "host", "pid"),
    *("started_ns", "uptime_s", "publishes", "subscribes"),
)


def running_nodes(
    session: ToolSession, names: Collection[str] | None = None
) -> tuple[list[NodeState], int]:
    """Return a snapshot of the running nodes, including those that do not answer.

    The snapshot has at most as many nodes as a fleet may have, beginning with those that answer;
    the second value is the number of nodes left out. A node that answers counts as running: among
    very many tokens, its own may arrive late.

    Args:
        session: An open session.
        names: Names whose tokens exist, for a tool that subscribes to tokens: with such a
            subscription, Zenoh 1.10 omits tokens from the replies to a query for them.
    """
    described, reports = session.ask_all(
        Query(keys.node_key(session.namespace, "*")),
        Query(keys.diagnostics_key(session.namespace, "*")),
    )
    # Asked alone: many tokens delay other replies.
    living = _living(session) if names is None else set(names)
    health: dict[tuple[str, str], tuple[Diagnostics]] = {}
    for reply, report in messages_in(reports, Diagnostics):
        with suppress(PayloadError):
            check(reply.name, report)
            health[reply.name, reply.session] = (report,)
    found: dict[tuple[str, str], NodeState] = {}
    for reply, description in messages_in(described, NodeDescription):
        with suppress(PayloadError):
            check(reply.name, description)
            if len(reply.name) <= MAX_NAME:
                found[reply.name, reply.session] = NodeState(
                    reply.name,
                    reply.session,
                    has_token=True,
                    answered=True,
                    description=description,
                    reports=health.get((reply.name, reply.session), ()),
                    clock=_clock(reply, description),
                )
    silent = living - {name for name, _ in found}
    tokens_alone = (NodeState(name, has_token=True) for name in silent if len(name) <= MAX_NAME)
    return bounded([*found.values(), *tokens_alone])


def left_out_note(count: int) -> str:
    """Return the note about nodes that are left out."""
    return f"{count} more are left out: {MAX_NODES} nodes are shown, those first that answer"


def parameters_by_session(session: ToolSession, node: str) -> dict[str, list[Parameter]]:
    """Return the parameters of the nodes of a name, or of all nodes with ``*``, by session."""
    found: dict[str, list[Parameter]] = {}
    replies = session.ask(keys.parameter_key(session.namespace, node, "*"))
    for reply, parameter in messages_in(replies, Parameter):
        found.setdefault(reply.session, []).append(parameter)
    return {who: sorted(those, key=lambda one: one.name) for who, those in found.items()}


def place(about: NodeDescription) -> str:
    """Return where a node runs: ``pid 812 on host``."""
    return f"pid {about.pid} on {about.host}"


def is_pattern(node: str) -> bool:
    """Tell whether a node is named by a pattern: ``*`` matches any characters, ``?`` one."""
    return "*" in node or "?" in node


def matching_nodes(session: ToolSession, pattern: str) -> tuple[list[str], int]:
    """Return the names of the running nodes that match a pattern, by their liveliness tokens.

    There are at most ``MAX_NODES``; the second value is the number of names left out.

    Raises:
        ExpectationNotMet: There is none; the text has the existing names.
    """
    found = sorted(name for name in _living(session) if fnmatchcase(name, pattern))
    if not found:
        raise missing_node(session, pattern)
    return found[:MAX_NODES], max(0, len(found) - MAX_NODES)


def missing_node(session: ToolSession, node: str) -> VisionError:
    """Return the error for a node, or a pattern, that has not answered for parameters."""
    living = _living(session)
    if session.stopping:
        return ToldToStop("told to stop while waiting for an answer")
    if silent := sorted(name for name in living if fnmatchcase(name, node)):
        verbs = "runs, but does" if len(silent) == 1 else "run, but do"
        return ExpectationNotMet(f"{joined(silent)} {verbs} not answer for parameters")
    return ExpectationNotMet(nothing_matches(node, living, kind="node"))


def _living(session: ToolSession) -> set[str]:
    """Return the names of the nodes that show a liveliness token."""
    (tokens,) = session.ask_all(tokens_query(session.namespace))
    return {token.name for token in tokens}


def node_facts(node: NodeState) -> dict[str, Any]:
    """Return a node's description as fields for JSON; only its name if it does not answer."""
    about = node.description if node.answered else None
    report = node.report if node.answered else None
    facts = dict.fromkeys(DESCRIBED)
    if about is not None:
        facts |= about.model_dump(mode="json", include=set(facts)) | {"uptime_s": node.uptime_s}
    return {
        "node": node.name,
        "answers": about is not None,
        **facts,
        "level": report and Level(report.level).name,
        "message": report and report.message,
    }


def health_facts(node: NodeState) -> dict[str, Any]:
    """Return a node's health in numbers as fields for JSON."""
    report = node.report if node.answered else None
    return {
        "counters": report and report.counters,
        "rate_hz": report and report.rate_hz,
        "latency_ms": report and report.latency_ms.to_map(),
    }


def duration(seconds: float | None) -> str:
    """Return a time in its two largest units: ``3 min 12 s``, ``2 d 5 h``."""
    if seconds is None:
        return "-"
    units = ((86400, "d"), (3600, "h"), (60, "min"), (1, "s"))
    for (size, unit), (smaller, smaller_unit) in pairwise(units):
        if seconds >= size:
            return f"{seconds // size:.0f} {unit} {seconds % size // smaller:.0f} {smaller_unit}"
    return f"{int(seconds)} s"


def _clock(reply: Reply, description: NodeDescription) -> ClockOffset | None:
    if description.stamp_ns is None:
        return None
    half_ns = (reply.received_ns - reply.sent_ns) // 2
    return ClockOffset(ahead_ns=description.stamp_ns - reply.sent_ns - half_ns, error_ns=half_ns)
