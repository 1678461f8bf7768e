"""Checks messages against a JSON Schema from the network, in bounded time.

It checks what pydantic writes of a message's fields: types, choices, alternatives, limits of
numbers and of lengths. Other keywords, such as patterns, are ignored, so a message that violates
only those is accepted. A schema may be hostile, so the steps of each check are counted.
"""

from __future__ import annotations

import json
import math
import operator
import reprlib
import sys
from typing import Any

MAX_BYTES = 64 << 10
MAX_STEPS = 50_000
"""Most values, fields and choices that are compared for one message: some 0.1 s."""

REFERENCE = "#/$defs/"
LIMITS = (
    ("minimum", operator.ge, "greater than or equal to"),
    ("maximum", operator.le, "less than or equal to"),
    ("exclusiveMinimum", operator.gt, "greater than"),
    ("exclusiveMaximum", operator.lt, "less than"),
)
KINDS: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (tuple, list),
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "null": (type(None),),
}

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


def error_in(schema: Schema, value: object, name: str) -> str:
    """Return the first error in a value: its place, what is wrong, and a part of the value.

    Empty if there is none.

    Args:
        schema: A schema that ``parsed`` returned.
        value: The value; the arrays in it are tuples or lists.
        name: The name of the value, with which its place begins.

    Raises:
        UnusableSchema: A part that is needed for the check is no schema, or it takes too long.
    """
    try:
        return _Check(schema).error(schema, value, name)
    except RecursionError:
        raise UnusableSchema("its references have no end") from None


class _Check:
    """One check of a value, which counts its steps."""

    def __init__(self, document: Schema) -> None:
        definitions = document.get("$defs")
        self._definitions = definitions if isinstance(definitions, dict) else {}
        self._left = MAX_STEPS

    def error(self, part: Any, value: Any, place: str) -> str:
        """Return the first error in a value; empty if there is none."""
        self._count(1)
        if part is True:
            return ""
        if not isinstance(part, dict):
            raise UnusableSchema(f"{reprlib.repr(part)} is no schema")
        if "$ref" in part:
            return self.error(self._referred(part["$ref"]), value, place)
        if "const" in part or "enum" in part:
            choices = _list(part, "enum") if "enum" in part else [part["const"]]
            self._count(len(choices))
            if any(type(each) is type(value) and each == value for each in choices):
                return ""
            return wrong(place, f"one of {reprlib.repr(choices)}", value)
        for name in ("anyOf", "oneOf"):
            if name in part:
                return self._error_in_all(_list(part, name), value, place)
        kind = part.get("type", "object" if "properties" in part else None)
        if isinstance(kind, list):
            return self._error_in_all([{**part, "type": each} for each in kind], value, place)
        return "" if kind is None else self._error_of_kind(part, kind, value, place)

    def _count(self, steps: int) -> None:
        self._left -= steps
        if self._left < 0:
            raise UnusableSchema(f"checking a message takes more than {MAX_STEPS} steps")

    def _referred(self, name: object) -> Any:
        if not isinstance(name, str) or name.removeprefix(REFERENCE) not in self._definitions:
            raise UnusableSchema(f"it refers to {reprlib.repr(name)}, which it does not define")
        return self._definitions[name.removeprefix(REFERENCE)]

    def _error_in_all(self, parts: list[Any], value: Any, place: str) -> str:
        """Return the error by the first of the alternatives; empty if one of them has none."""
        first = ""
        for part in parts:
            error = self.error(part, value, place)
            if not error:
                return ""
            first = first or error
        return first

    def _error_of_kind(self, part: Schema, kind: Any, value: Any, place: str) -> str:
        if not isinstance(kind, str) or kind not in KINDS:
            raise UnusableSchema(f"type = {reprlib.repr(kind)} is none of JSON Schema")
        binary = kind == "string" and part.get("format") == "binary" and isinstance(value, bytes)
        right = isinstance(value, KINDS[kind]) and (kind == "boolean") == isinstance(value, bool)
        if not (right or binary) or (isinstance(value, float) and not math.isfinite(value)):
            return wrong(place, f"a valid {kind}", value)
        if kind == "object":
            return self._error_in_fields(part, value, place)
        if kind == "array":
            return self._error_in_items(part, value, place)
        if kind == "string":
            return _length_error(part, ("minLength", "maxLength"), value, place)
        if kind in ("integer", "number"):
            for name, fits, words in LIMITS:
                limit = _number(part, name)
                if limit is not None and not fits(value, limit):
                    return wrong(place, f"{words} {limit:g}", value)
        return ""

    def _error_in_fields(self, part: Schema, value: dict[Any, Any], place: str) -> str:
        if "properties" not in part:  # a map from any names to values of one type
            values = part.get("additionalProperties", True)
            fields = dict.fromkeys(value, values)
            if value and values is False:
                return wrong(place, "empty", value)
        else:
            fields = part["properties"]
        if not isinstance(fields, dict):
            raise UnusableSchema(f"properties = {reprlib.repr(fields)} is no object")
        required = _list(part, "required") if "required" in part else []
        self._count(len(fields) + len(required))
        for name in required:
            if not isinstance(name, str):
                raise UnusableSchema(f"required = {reprlib.repr(required)} are no names")
            if name not in value:
                return f"{place}.{name}: Field required"
        for name, each in fields.items():
            if name in value and (error := self.error(each, value[name], f"{place}.{name}")):
                return error
        return ""

    def _error_in_items(self, part: Schema, value: Any, place: str) -> str:
        parts = _list(part, "prefixItems") if "prefixItems" in part else None
        if parts is not None and len(parts) != len(value):
            return wrong(place, f"a list of {len(parts)} items", value)
        if parts is None and (error := _length_error(part, ("minItems", "maxItems"), value, place)):
            return error
        parts = parts or [part.get("items", True)] * len(value)
        for index, (each, item) in enumerate(zip(parts, value, strict=True)):
            if error := self.error(each, item, f"{place}.{index}"):
                return error
        return ""


def wrong(place: str, allowed: str, value: object) -> str:
    """Return an error text in the words of pydantic, which checks the messages of this project."""
    return f"{place}: Input should be {allowed}, got {reprlib.repr(value):.80}"


def _length_error(part: Schema, names: tuple[str, str], value: Any, place: str) -> str:
    low, high = (_number(part, name) for name in names)
    if (low is not None and len(value) < low) or (high is not None and len(value) > high):
        limits = f"{'any' if low is None else low:} to {'any' if high is None else high}"
        return wrong(place, f"of {limits} items or characters", value)
    return ""


def _list(part: Schema, name: str) -> list[Any]:
    items = part[name]
    if not isinstance(items, list) or not (items or name in ("required", "prefixItems")):
        raise UnusableSchema(f"{name} = {reprlib.repr(items)} is no list of values")
    return items


def _number(part: Schema, name: str) -> float | None:
    value = part.get(name)
    if value is None or (type(value) in (int, float) and abs(value) <= sys.float_info.max):
        return value
    raise UnusableSchema(f"{name} = {reprlib.repr(value)} is no number")
