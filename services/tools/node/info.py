"""``zv node info``: all that a node says of itself."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from typing import Any

from common.connection import Connection
from common.errors import ExpectationNotMet
from common.messages import Parameter
from services.tools.facts import duration, facts
from services.tools.namespaces import nobody_here
from services.tools.nearest import nothing_matches
from services.tools.node.options import InfoOptions
from services.tools.nodes import Presence, parameters, present
from services.tools.output import Output
from services.tools.session import ToolSession

WIDTH = 12


def run(options: InfoOptions, connection: Connection, output: Output) -> None:
    """Print what each node of a name, or that a pattern matches, says of itself.

    Raises:
        ExpectationNotMet: There is none; names those that there are.
    """
    with ToolSession(connection) as session:
        everyone = present(session)
        found = [each for each in everyone if fnmatchcase(each.name, options.node)]
        if session.stopping:
            return
        if not everyone:
            raise ExpectationNotMet(nobody_here(session))
        if not found:
            names = [each.name for each in everyone]
            raise ExpectationNotMet(nothing_matches(options.node, names, kind="node"))
        settings = {name: parameters(session, name) for name in {each.name for each in found}}
        for index, each in enumerate(found):
            own = settings[each.name].get(each.session or "", [])
            if output.as_json:
                output.record(facts(each) | detail(each, own))
                continue
            if index:
                output.line()
            for line in lines(each, own):
                output.line(line)


def detail(presence: Presence, own: Iterable[Parameter]) -> dict[str, Any]:
    """Return what the list of nodes does not show: health in figures, and parameters."""
    report = presence.report
    return {
        "counters": report and report.counters,
        "rate_hz": report and report.rate_hz,
        "latency_ms": report and report.latency_ms.to_map(),
        "parameters": [parameter.to_map() for parameter in own],
    }


def lines(presence: Presence, own: Iterable[Parameter]) -> Iterator[str]:
    """Yield the lines about a node."""
    yield presence.name
    about = facts(presence)
    if not about["answers"]:
        yield named("health", "shows its token but does not answer")
        return
    yield named("service", about["service"])
    yield named("cameras", " ".join(about["cameras"]) or "-")
    yield named("version", about["version"])
    yield named("host", f"{about['host']}, pid {about['pid']}")
    yield named("uptime", duration(about["uptime_s"]))
    report = presence.report
    yield named("health", f"{about['level']}: {report.message}" if report else "no report yet")
    if report:
        p50, p99 = report.latency_ms.p50, report.latency_ms.p99
        latency = "-" if p50 is None or p99 is None else f"{p50:.1f} ms, p99 {p99:.1f} ms"
        yield named("rate", f"{report.rate_hz:.1f} Hz")
        yield named("latency", latency)
        yield from several("counters", [f"{name} {n}" for name, n in report.counters.items()])
    yield from several("publishes", about["publishes"])
    yield from several("subscribes", about["subscribes"])
    if settings := [spelled(parameter) for parameter in own]:
        yield from several("parameters", settings)


def named(name: str, value: object) -> str:
    """Return a line of a name and its value."""
    return f"  {name:<{WIDTH}}{value}".rstrip()


def several(name: str, values: list[str]) -> Iterator[str]:
    """Yield a line for each value, the name before the first."""
    for index, value in enumerate(values or ["-"]):
        yield named("" if index else name, value)


def spelled(parameter: Parameter) -> str:
    """Return a parameter with its unit and what it may be: ``quality = 80 (1 to 100)``."""
    unit = f" {parameter.unit}" if parameter.unit and parameter.value is not None else ""
    limits = ""
    if parameter.choices:
        limits = f" ({', '.join(map(str, parameter.choices))})"
    elif parameter.minimum is not None and parameter.maximum is not None:
        limits = f" ({parameter.minimum:.12g} to {parameter.maximum:.12g})"
    value = "not set" if parameter.value is None else json.dumps(parameter.value)
    return f"{parameter.name} = {value}{unit}{limits}"
