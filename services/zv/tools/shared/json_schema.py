"""JSON Schemas from the network: their texts, and the parts to which they refer."""

from __future__ import annotations

import json
from typing import Any, Final

MAX_BYTES: Final = 64 << 10
REFERENCE: Final = "#/$defs/"

Schema = dict[str, Any]


class UnusableSchema(Exception):
    """A schema is broken, or larger than allowed; the text says in what way."""


def parsed(text: bytes) -> Schema:
    """Return the schema of an object in a JSON text.

    Raises:
        UnusableSchema: It is too large, not JSON, or not the schema of an object.
    """
    if len(text) > MAX_BYTES:
        raise UnusableSchema(f"it has {len(text)} bytes, at most {MAX_BYTES} are allowed")
    try:
        schema = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UnusableSchema(f"it is not JSON: {error}") from None
    if not isinstance(schema, dict) or not isinstance(schema.get("properties"), dict):
        raise UnusableSchema("it describes no object with properties")
    return schema


def resolved(schema: Schema, part: object) -> Schema:
    """Return a part of a schema, or the one that it refers to; empty if there is none."""
    name = part.get("$ref") if isinstance(part, dict) else None
    if isinstance(name, str):
        definitions = schema.get("$defs")
        known = definitions if isinstance(definitions, dict) else {}
        part = known.get(name.removeprefix(REFERENCE))
    return part if isinstance(part, dict) else {}
