"""``zv node info``: shows the details of nodes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Parameter
from zenoh_vision.transport.connection import Connection
from zv.tools.node.options import InfoOptions
from zv.tools.shared.discovery import no_nodes, nothing_matches
from zv.tools.shared.nodes import (
    NO_ANSWER,
    duration,
    health_facts,
    left_out_note,
    node_facts,
    parameters_by_session,
    running_nodes,
)
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

WIDTH = 12


def run(options: InfoOptions, connection: Connection, output: Output) -> None:
    """Print the details of each node that matches a name or pattern.

    Raises:
        ExpectationNotMet: There is no such node; the text has the existing names.
    """
    with ToolSession(connection) as session:
        nodes, left_out = running_nodes(session)
        found = [node for node in nodes if fnmatchcase(node.name, options.node)]
        if session.stopping:
            return
        if not nodes:
            raise ExpectationNotMet(no_nodes(session))
        if not found:
            names = [node.name for node in nodes]
            raise ExpectationNotMet(nothing_matches(options.node, names, kind="node"))
        answering = {node.name for node in found if node.answered}
        known = {name: parameters_by_session(session, name) for name in answering}
        for index, node in enumerate(found):
            own = known.get(node.name, {}).get(node.session, [])
            settings = {"parameters": [parameter.to_map() for parameter in own]}
            above = [""] if index else []
            facts = node_facts(node) | health_facts(node) | settings
            output.result(facts, *above, *lines(node, own))
        if left_out:
            output.note(left_out_note(left_out))


def lines(node: NodeState, own: Sequence[Parameter]) -> Iterator[str]:
    """Yield the lines that describe a node."""
    yield node.name
    about = node_facts(node)
    if not about["answers"]:
        yield named("health", NO_ANSWER)
        return
    yield named("service", about["service"])
    yield named("cameras", " ".join(about["cameras"]) or "-")
    yield named("version", about["version"])
    yield named("host", f"{about['host']}, pid {about['pid']}")
    if about["pipeline"] is not None:
        yield named("pipeline", about["pipeline"])
    yield named("uptime", duration(about["uptime_s"]))
    report = node.report
    yield named("health", f"{about['level']}: {report.message}" if report else "no report yet")
    if report:
        p50, p99 = report.latency_ms.p50, report.latency_ms.p99
        latency = "-" if p50 is None or p99 is None else f"{p50:.1f} ms, p99 {p99:.1f} ms"
        yield named("rate", f"{report.rate_hz:.1f} Hz")
        yield named("latency", latency)
        yield from several("counters", [f"{name} {n}" for name, n in report.counters.items()])
    yield from several("publishes", about["publishes"])
    routes = (report.routes if report else None) or {}
    taken = [f"{key} ({routes[key]})" if key in routes else key for key in about["subscribes"]]
    yield from several("subscribes", taken)
    if own:
        yield from several("parameters", list(map(spelled, own)))


def named(name: str, value: object) -> str:
    """Return a line of a name and its value."""
    return f"  {name:<{WIDTH}}{value}".rstrip()


def several(name: str, values: list[str]) -> Iterator[str]:
    """Yield a line for each value; the first one begins with the name."""
    for index, value in enumerate(values or ["-"]):
        yield named("" if index else name, value)


def spelled(parameter: Parameter) -> str:
    """Return a parameter with its unit and allowed values: ``quality = 80 (1 to 100)``."""
    unit = f" {parameter.unit}" if parameter.unit and parameter.value is not None else ""
    limits = ""
    if parameter.choices:
        limits = f" ({', '.join(map(str, parameter.choices))})"
    elif parameter.minimum is not None and parameter.maximum is not None:
        limits = f" ({parameter.minimum:.12g} to {parameter.maximum:.12g})"
    value = "not set" if parameter.value is None else json.dumps(parameter.value)
    return f"{parameter.name} = {value}{unit}{limits}"
