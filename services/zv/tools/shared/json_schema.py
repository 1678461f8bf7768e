"""Turns a JSON Schema from the network into a validator of bounded cost.

The validation is pydantic's own, so errors read as those of known messages. A node's schema is
that of a pydantic model. Keywords that pydantic does not write are ignored, so a message that
violates only those is accepted. Recursive parts accept anything: together with alternatives, their
validation could take time that grows exponentially with the depth of a message.
"""

from __future__ import annotations

import json
import math
import re
import reprlib
from collections.abc import Callable
from typing import Any

from pydantic_core import CoreSchema, SchemaError, SchemaValidator, core_schema

MAX_BYTES = 64 << 10
MAX_PARTS = 2000
MAX_DEPTH = 16
MAX_ALTERNATIVES = 16
"""Limit of the product of alternatives on any path, and so of the cost of checking a value."""

MAX_VALUES = 1000
MAX_PATTERNS = 20
MAX_PATTERN = 100
"""Longer patterns, and those beyond the first 20, are ignored, since compiling takes time."""

MAX_PATTERNS_COST = 25_000
"""Limit of the cost of all patterns by ``pattern_cost``, some 0.2 s; those beyond are ignored."""

MAX_PATTERN_COST = 1_000_000
"""A schema with a pattern that costs more is refused."""

CLASS_COST, FLAG_COST = 100, 300
"""Cost of a Unicode class, and of a group with flags, in characters."""

UNICODE_CLASS = re.compile(r"\\[wWdDsSpPbB]")
COUNTED = re.compile(r"(.?)\{\s*([0-9]*)[\s,]*([0-9]*)", re.DOTALL)

REFERENCE = "#/$defs/"
SCALARS = (str, int, bool, type(None))

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


def validator_of(schema: Schema) -> SchemaValidator:
    """Return the validator of maps that are decoded with tuples for arrays; use it with strict.

    Raises:
        UnusableSchema: A part of it is not a schema, or it is too large.
    """
    try:
        made = _Conversion(schema).schema(schema, MAX_DEPTH, 1)
        return SchemaValidator(made)
    except (SchemaError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise UnusableSchema(str(error).partition("\n")[0][:200]) from None


def resolved(schema: Schema, part: object) -> Schema:
    """Return a part of a schema, or the one that it refers to; empty if there is none."""
    name = part.get("$ref") if isinstance(part, dict) else None
    if isinstance(name, str):
        definitions = schema.get("$defs")
        part = (
            definitions.get(name.removeprefix(REFERENCE)) if isinstance(definitions, dict) else {}
        )
    return part if isinstance(part, dict) else {}


def pattern_cost(pattern: str) -> int:
    """Return an upper limit of the cost of compiling a regular expression, in plain characters.

    Counted repetitions are compiled as copies. Those of groups multiply the others.
    """
    flags = pattern.count("(?")
    added, factor = 0, 1
    for before, low, high in COUNTED.findall(pattern):
        times = max(1, int(low or 0), int(high or 0))
        if flags or before in {*")}*+?"}:  # a flag may allow spaces before the braces
            factor *= times
        else:
            added += times
    classes = len(UNICODE_CLASS.findall(pattern))
    return (len(pattern) + classes * CLASS_COST + flags * FLAG_COST) * max(1, added) * factor


class _Conversion:
    """Converts one schema, and counts its parts."""

    def __init__(self, document: Schema) -> None:
        definitions = document.get("$defs", {})
        self._definitions = definitions if isinstance(definitions, dict) else {}
        self._open: list[str] = []
        self._parts = 0
        self._patterns = 0
        self._patterns_cost = 0
        self._by_type: dict[str, Callable[[Schema, int, int], CoreSchema]] = {
            "object": self._object,
            "array": self._array,
            "string": self._text,
            "integer": self._integer,
            "number": self._number,
            "boolean": lambda *_: core_schema.bool_schema(),
            "null": lambda *_: core_schema.none_schema(),
        }

    def schema(self, part: object, depth: int, alternatives: int) -> CoreSchema:
        """Return the schema for pydantic of a part.

        Args:
            part: A JSON Schema.
            depth: How deep it may be nested.
            alternatives: Product of the alternatives around it.
        """
        self._parts += 1
        if self._parts > MAX_PARTS or depth == 0:
            raise UnusableSchema(
                f"it is too large: at most {MAX_PARTS} parts, {MAX_DEPTH} levels deep, are allowed"
            )
        if part is True:
            return core_schema.any_schema()
        if not isinstance(part, dict):
            raise UnusableSchema(f"{reprlib.repr(part)} is no schema")
        if "$ref" in part:
            return self._referred(part["$ref"], depth, alternatives)
        if "const" in part or "enum" in part:
            return _choice(part.get("enum", [part.get("const")]))
        for name in ("anyOf", "oneOf"):
            if name in part:
                return self._either(_items(part, name), depth, alternatives)
        return self._of_type(part, depth, alternatives)

    def _of_type(self, part: Schema, depth: int, alternatives: int) -> CoreSchema:
        kind = part.get("type", "object" if "properties" in part else None)
        if isinstance(kind, list):
            return self._either([{**part, "type": each} for each in kind], depth, alternatives)
        if kind is None:
            return core_schema.any_schema()
        if not isinstance(kind, str) or kind not in self._by_type:
            raise UnusableSchema(f"type = {reprlib.repr(kind)} is none of JSON Schema")
        return self._by_type[kind](part, depth, alternatives)

    def _referred(self, name: object, depth: int, alternatives: int) -> CoreSchema:
        if not isinstance(name, str) or name.removeprefix(REFERENCE) not in self._definitions:
            raise UnusableSchema(f"it refers to {reprlib.repr(name)}, which it does not define")
        if name in self._open:
            return core_schema.any_schema()
        self._open.append(name)
        made = self.schema(self._definitions[name.removeprefix(REFERENCE)], depth - 1, alternatives)
        self._open.pop()
        return made

    def _either(self, parts: list[Any], depth: int, alternatives: int) -> CoreSchema:
        alternatives *= len([part for part in parts if part != {"type": "null"}]) or 1
        if alternatives > MAX_ALTERNATIVES:
            raise UnusableSchema(f"it allows more than {MAX_ALTERNATIVES} alternatives at a place")
        return core_schema.union_schema(
            [self.schema(part, depth - 1, alternatives) for part in parts]
        )

    def _object(self, part: Schema, depth: int, alternatives: int) -> CoreSchema:
        properties = part.get("properties")
        if properties is None:
            values = part.get("additionalProperties", True)
            return core_schema.dict_schema(
                core_schema.str_schema(),
                self.schema(values, depth - 1, alternatives) if values is not False else None,
                max_length=0 if values is False else None,
            )
        if not isinstance(properties, dict):
            raise UnusableSchema(f"properties = {reprlib.repr(properties)} is no object")
        required = _items(part, "required") if "required" in part else []
        return core_schema.typed_dict_schema(
            {
                name: core_schema.typed_dict_field(
                    self.schema(each, depth - 1, alternatives), required=name in required
                )
                for name, each in properties.items()
            },
            extra_behavior="ignore",
        )

    def _array(self, part: Schema, depth: int, alternatives: int) -> CoreSchema:
        low, high = _length(part, "minItems"), _length(part, "maxItems")
        if "prefixItems" in part:
            items = _items(part, "prefixItems")
            return core_schema.tuple_schema(
                [self.schema(each, depth - 1, alternatives) for each in items]
            )
        return core_schema.tuple_schema(
            [self.schema(part.get("items", True), depth - 1, alternatives)],
            variadic_item_index=0,
            min_length=low,
            max_length=high,
            fail_fast=True,
        )

    def _text(self, part: Schema, _depth: int, _alternatives: int) -> CoreSchema:
        text = core_schema.str_schema(
            pattern=self._pattern(part.get("pattern")),
            min_length=_length(part, "minLength"),
            max_length=_length(part, "maxLength"),
        )
        if part.get("format") == "binary":
            return core_schema.union_schema([core_schema.bytes_schema(), text])
        return text

    def _pattern(self, pattern: object) -> str | None:
        """Return a pattern; None if it is not valid, or is ignored because of its cost."""
        if not isinstance(pattern, str) or len(pattern) > MAX_PATTERN:
            return None
        cost = pattern_cost(pattern)
        if cost > MAX_PATTERN_COST:
            raise UnusableSchema(f"pattern = {reprlib.repr(pattern)} is too large when compiled")
        fits = self._patterns_cost + cost <= MAX_PATTERNS_COST
        if not fits or self._patterns == MAX_PATTERNS:
            return None
        self._patterns += 1
        self._patterns_cost += cost
        return pattern

    def _integer(self, part: Schema, _depth: int, _alternatives: int) -> CoreSchema:
        low, high = _number(part, "minimum"), _number(part, "maximum")
        above, below = _number(part, "exclusiveMinimum"), _number(part, "exclusiveMaximum")
        return core_schema.int_schema(
            ge=None if low is None else math.ceil(low),
            le=None if high is None else math.floor(high),
            gt=None if above is None else math.floor(above),
            lt=None if below is None else math.ceil(below),
        )

    def _number(self, part: Schema, _depth: int, _alternatives: int) -> CoreSchema:
        return core_schema.float_schema(
            ge=_number(part, "minimum"),
            le=_number(part, "maximum"),
            gt=_number(part, "exclusiveMinimum"),
            lt=_number(part, "exclusiveMaximum"),
            allow_inf_nan=False,
        )


def _choice(values: object) -> CoreSchema:
    if not isinstance(values, list) or not values or len(values) > MAX_VALUES:
        raise UnusableSchema(
            f"enum = {reprlib.repr(values)} is no list of 1 to {MAX_VALUES} values"
        )
    if not all(isinstance(each, SCALARS) for each in values):
        return core_schema.any_schema()
    return core_schema.literal_schema(values)


def _items(part: Schema, name: str) -> list[Any]:
    items = part[name]
    if not isinstance(items, list) or len(items) > MAX_VALUES:
        raise UnusableSchema(f"{name} = {reprlib.repr(items)} is no list of at most {MAX_VALUES}")
    return items


def _number(part: Schema, name: str) -> float | None:
    value = part.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise UnusableSchema(f"{name} = {reprlib.repr(value)} is no number")
    return value


def _length(part: Schema, name: str) -> int | None:
    value = _number(part, name)
    if value is None:
        return None
    if not isinstance(value, int) or not 0 <= value < 2**31:
        raise UnusableSchema(f"{name} = {reprlib.repr(value)} is no length")
    return value
