"""``zv schema``: print the JSON Schema of a message, or list the messages.

Those of this project need no network; those of other programs are queried from their nodes.
"""

from __future__ import annotations

import inspect
import json
from dataclasses import replace

from zenoh_vision.error_text import printable
from zenoh_vision.errors import ConfigurationError, RouterUnreachable
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES, known_message
from zenoh_vision.topics import TOPICS
from zenoh_vision.transport.connection import Connection
from zv.tools.schema.options import SchemaOptions
from zv.tools.shared.message_types import (
    Answers,
    MessageType,
    foreign_types,
    keys_by_schema,
    type_named,
)
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

LIST_WAIT_S = 1.0
"""How long a list waits for a router: without one, it has only the messages of this project."""

OTHER_KEYS = {
    "vision.Header.v1": "attachment of every picture and message",
    "vision.Diagnostics.v1": "@{ns}/diagnostics/{node}",
    "vision.Parameter.v1": "@{ns}/param/{node}/{name}",
    "vision.ParameterList.v1": "@{ns}/param/{node}",
    "vision.Refusal.v1": "error reply on @{ns}/param/{node}, @{ns}/set/{node}",
    "vision.Node.v1": "@{ns}/node/{node}",
}
"""Keys of the messages that belong to no camera's topic."""


def run(options: SchemaOptions, connection: Connection, output: Output) -> None:
    """Print one schema, or a list of all messages.

    Raises:
        ConfigurationError: There is no such message, or the schema of a node cannot be used.
    """
    if options.name is not None:
        schema = _type(options.name, connection).schema
        output.result(schema, *json.dumps(schema, indent=2).split("\n"))
        return
    rows, records = [], []
    for schema_name, message in MESSAGES.items():
        name, keys, meaning = message.short_name(), _keys_of(message), inspect.getdoc(message) or ""
        rows.append((name, schema_name, ", ".join(keys), meaning.partition("\n")[0]))
        records.append({"name": name, "schema": schema_name, "keys": keys, "meaning": meaning})
    try:
        with ToolSession(_within(connection, LIST_WAIT_S)) as session:
            answers = foreign_types(session)
            keys_of = keys_by_schema(session) if answers.types else {}
    except RouterUnreachable:
        answers, keys_of = Answers({}, {}, {}), {}
    for schema_name, found in sorted(answers.types.items()):
        keys = keys_of.get(schema_name, [])
        rows.append((found.short_name, schema_name, ", ".join(keys), printable(found.meaning)))
        names = {"name": found.short_name, "schema": schema_name}
        records.append({**names, "keys": keys, "meaning": found.meaning})
    output.table(list(records[0]), rows, records)
    for problem in answers.problems.values():
        output.note(problem)


def _type(name: str, connection: Connection) -> MessageType:
    if known_message(name) is not None:
        return type_named(name, lambda: Answers({}, {}, {}))
    try:
        with ToolSession(connection) as session:
            return type_named(name, lambda: foreign_types(session))
    except RouterUnreachable as error:
        try:
            return type_named(name, lambda: Answers({}, {}, {}))
        except ConfigurationError as unknown:
            text = f"{unknown}; no running node could be asked: {error}"
            raise ConfigurationError(text) from None


def _within(connection: Connection, most_s: float) -> Connection:
    given_s = connection.timeout_s
    return replace(connection, timeout_s=most_s if given_s is None else min(given_s, most_s))


def _keys_of(message: type[Message]) -> list[str]:
    found = [topic.key("{ns}", "{camera}") for topic in TOPICS.values() if topic.message is message]
    return found or [OTHER_KEYS[message.schema_name]]
