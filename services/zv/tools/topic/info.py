"""``zv topic info``: show a key's type, publishers, subscribers and newest sample."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from zenoh_vision import keys
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.keys import type_of
from zenoh_vision.messages import Diagnostics
from zenoh_vision.topics import topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.query import Query, messages_in
from zv.tools.shared.discovery import Discovery, discover
from zv.tools.shared.message_fields import INDENT, fields_of, lines_of, map_in
from zv.tools.shared.output import Output
from zv.tools.shared.received import Received, received
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.topic.list import Entry, observe
from zv.tools.topic.options import InfoOptions

DELIVERIES = {
    "frame": "BLOCK_FIRST, data priority: whole frames or none on a slow link",
    "message": "BLOCK, high priority: small, overtakes frames",
}


def run(options: InfoOptions, connection: Connection, output: Output) -> None:
    """Print the details of each key that matches.

    Raises:
        ExpectationNotMet: No key matches.
    """
    pattern = key_expression(options.key)
    with ToolSession(connection) as session:
        found = discover(session)
        entries = observe(session, found, pattern, options.window, output)
        reported = Query(keys.diagnostics_key(session.namespace, "*"))
        answers, reports = session.ask_all(Query(pattern), reported)
        replies = [reply.ok for reply in answers if reply.ok is not None]
        routes = {
            reply.name: report.routes
            for reply, report in messages_in(reports, Diagnostics)
            if report.node == reply.name and report.routes
        }
        newest = {str(sample.key_expr): received(sample) for sample in replies}
        if session.stopping:
            return
        if not entries:
            raise ExpectationNotMet(found.nothing_on(pattern))
        for entry in entries:
            about = _describe(entry, found, newest.get(entry.key), routes)
            shown = {name: value for name, value in about.items() if name != "key"}
            output.result(about, entry.key, *lines_of(shown, INDENT))


def _describe(
    entry: Entry,
    found: Discovery,
    newest: Received | None,
    routes: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Return the details of a key; ``routes`` says how the frames of each key come to each node."""
    topic = topic_of(entry.key)
    encoding = entry.encoding if newest is None else newest.encoding
    nodes = {
        node.node: {"host": node.host, "pid": node.pid, "version": node.version}
        for node in found.nodes
    }
    about: dict[str, Any] = {
        **asdict(entry),
        "encoding": encoding or None,
        "type": type_of(encoding),
        "publishers": [{"node": name, **nodes.get(name, {})} for name in entry.publishers],
        "subscribing_nodes": (subscribing := found.nodes_subscribing(entry.key)),
    }
    taken = {name: routes.get(name, {}).get(entry.key) for name in subscribing}
    if any(taken.values()):
        about["routes"] = {name: route for name, route in taken.items() if route}
    # Only the programs themselves know how they publish.
    if topic is not None and any(name in nodes for name in entry.publishers):
        about["made"] = "while someone subscribes or asks" if topic.lazy else "always"
        about["delivery"] = DELIVERIES[topic.delivery]
    about["newest"] = None if newest is None else _newest(newest)
    return about


def _newest(sample: Received) -> dict[str, Any]:
    header = map_in(sample.attachment)
    about: dict[str, Any] = {}
    if header is not None:
        if isinstance(stamp_ns := header.get("replayed_ns", header.get("stamp_ns")), int):
            about["age_ms"] = round((time.time_ns() - stamp_ns) / 1e6, 1)
        about["header"] = header
    fields = fields_of(sample, header=False)
    if sample.is_picture:
        return about | fields
    return about | {"fields": list(fields), "bytes": sample.size}
