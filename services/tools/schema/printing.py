"""Prints a message's JSON Schema, or which messages there are."""

from __future__ import annotations

import inspect
import json

from common.connection import Connection
from common.keys import TOPICS
from services.tools.output import Output
from services.tools.schema.options import SchemaOptions
from services.tools.types import MESSAGES, message_named, schema_of, short_name

OTHER_KEYS = {
    "vision.Header.v1": "attachment of every picture and message",
    "vision.Diagnostics.v1": "@{ns}/diagnostics/{node}",
    "vision.Parameter.v1": "@{ns}/param/{node}/{name}",
    "vision.ParameterList.v1": "@{ns}/param/{node}",
    "vision.Refusal.v1": "error reply on @{ns}/param/{node}",
    "vision.Node.v1": "@{ns}/node/{node}",
}
INDENT = 2


def run(options: SchemaOptions, _connection: Connection, output: Output) -> None:
    """Print.

    Raises:
        ConfigurationError: There is no such message.
    """
    if options.name is not None:
        schema = message_named(options.name).model_json_schema()
        output.line(json.dumps(schema, indent=None if output.as_json else INDENT))
        return
    rows = [
        (short_name(name), name, keys_of(name), inspect.getdoc(message) or "")
        for name, message in MESSAGES.items()
    ]
    if output.as_json:
        for short, name, keys, meaning in rows:
            output.record({"name": short, "schema": name, "keys": keys, "meaning": meaning})
        return
    output.table(
        ("name", "schema", "keys", "meaning"),
        [
            (short, name, ", ".join(keys), meaning.partition("\n")[0])
            for short, name, keys, meaning in rows
        ],
    )


def keys_of(schema_name: str) -> list[str]:
    """Return the keys on which a message travels."""
    found = [
        topic.key("{ns}", "{camera}")
        for topic in TOPICS.values()
        if schema_of(topic.encoding) == schema_name
    ]
    return found or [OTHER_KEYS[schema_name]]
