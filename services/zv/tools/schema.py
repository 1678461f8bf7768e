"""``zv schema``: print the JSON Schema of a message, or list the messages."""

from __future__ import annotations

import inspect
import json
from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Argument
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES, message_named
from zenoh_vision.topics import TOPICS
from zenoh_vision.transport.connection import Connection
from zv.tools.shared.options import ToolOptions
from zv.tools.shared.output import Output

OTHER_KEYS = {
    "vision.Header.v1": "attachment of every picture and message",
    "vision.Diagnostics.v1": "@{ns}/diagnostics/{node}",
    "vision.Parameter.v1": "@{ns}/param/{node}/{name}",
    "vision.ParameterList.v1": "@{ns}/param/{node}",
    "vision.Refusal.v1": "error reply on @{ns}/param/{node}",
    "vision.Node.v1": "@{ns}/node/{node}",
}
"""Keys of the messages that belong to no topic of a camera."""


class SchemaOptions(ToolOptions):
    """Options of ``zv schema``."""

    name: Annotated[
        str | None,
        Argument("NAME"),
        Field(description="message, such as Centroid or vision.Centroid.v1; default: list all"),
    ] = None


def run(options: SchemaOptions, _connection: Connection, output: Output) -> None:
    """Print one schema, or a list of all messages.

    Raises:
        ConfigurationError: There is no such message.
    """
    if options.name is not None:
        schema = message_named(options.name).model_json_schema()
        output.result(schema, *json.dumps(schema, indent=2).split("\n"))
        return
    rows, records = [], []
    for schema_name, message in MESSAGES.items():
        name, keys, meaning = message.short_name(), _keys_of(message), inspect.getdoc(message) or ""
        rows.append((name, schema_name, ", ".join(keys), meaning.partition("\n")[0]))
        records.append({"name": name, "schema": schema_name, "keys": keys, "meaning": meaning})
    output.table(list(records[0]), rows, records)


def _keys_of(message: type[Message]) -> list[str]:
    """Return the keys on which a message is sent."""
    found = [topic.key("{ns}", "{camera}") for topic in TOPICS.values() if topic.message is message]
    return found or [OTHER_KEYS[message.schema_name]]
