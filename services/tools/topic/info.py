"""``zv topic info``: who publishes and subscribes a key, what is on it, how fast."""

from __future__ import annotations

import time
from typing import Any

from common.connection import Connection
from common.errors import ExpectationNotMet
from services.tools.output import Output
from services.tools.session import ToolSession, key_expression
from services.tools.survey import Survey, survey
from services.tools.topic.contents import Received, fields_of, header_fields, received
from services.tools.topic.observing import Entry, observe
from services.tools.topic.options import InfoOptions
from services.tools.topic.rendering import lines_of
from services.tools.types import topic_of, type_of

DELIVERIES = {
    "frame": "BLOCK_FIRST, data priority: whole frames or none on a slow link",
    "message": "BLOCK, high priority: small, overtakes frames",
}


def run(options: InfoOptions, connection: Connection, output: Output) -> None:
    """Say all that is known of each key that matches.

    Raises:
        ExpectationNotMet: None does.
    """
    pattern = key_expression(options.key)
    with ToolSession(connection) as session:
        found = survey(session)
        entries = observe(session, found, pattern, options.window)
        newest = {
            str(reply.ok.key_expr): received(reply.ok)
            for reply in session.ask(pattern)
            if reply.ok is not None
        }
        if session.stopping:
            return
        if not entries:
            raise ExpectationNotMet(found.nothing_on(pattern))
        for entry in entries:
            about = describe(entry, found, newest.get(entry.key))
            if output.as_json:
                output.record(about)
                continue
            output.line(entry.key)
            for line in lines_of({name: value for name, value in about.items() if name != "key"}):
                output.line(f"  {line}")


def describe(entry: Entry, found: Survey, newest: Received | None) -> dict[str, Any]:
    """Return what is known of a key.

    Args:
        entry: As the list has it.
        found: What there is.
        newest: The newest sample, if someone answered.
    """
    topic = topic_of(entry.key)
    encoding = newest.encoding if newest is not None else entry.encoding
    nodes = {node.node: node for node in found.nodes}
    about: dict[str, Any] = {
        **entry.record(),
        "encoding": encoding or None,
        "type": type_of(encoding),
        "publishers": [
            {
                "node": name,
                "host": nodes[name].host,
                "pid": nodes[name].pid,
                "version": nodes[name].version,
            }
            if name in nodes
            else {"node": name}
            for name in entry.publishers
        ],
        "subscribing_nodes": found.nodes_subscribing(entry.key),
    }
    if topic is not None:
        about["made"] = "while someone subscribes or asks" if topic.lazy else "always"
        about["delivery"] = DELIVERIES[topic.delivery]
    about["newest"] = None if newest is None else _newest(newest)
    return about


def _newest(sample: Received) -> dict[str, Any]:
    fields = fields_of(sample, header=False)
    header = header_fields(sample)
    about: dict[str, Any] = {}
    if header is not None:
        stamp_ns = header.get("stamp_ns")
        if isinstance(stamp_ns, int):
            about["age_ms"] = round((time.time_ns() - stamp_ns) / 1e6, 1)
        about["header"] = header
    if sample.is_picture:
        about |= fields
    else:
        about |= {"fields": list(fields), "bytes": sample.size}
    return about
