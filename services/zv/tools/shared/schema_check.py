"""Checks messages against a JSON Schema from the network, by ``jsonschema``, in bounded time.

A schema may be hostile. The steps of each check are counted, nothing is fetched, and the keywords
whose time cannot be bounded are ignored, so a message that violates only those is accepted.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Iterator
from typing import Any, Final

from jsonschema import Draft202012Validator, ValidationError, validators
from jsonschema.exceptions import best_match
from referencing import Registry

from zv.tools.shared.json_schema import Schema, UnusableSchema

MAX_STEPS: Final = 50_000
"""Most keywords, fields, items and choices that are looked at for one message: some 0.3 s."""

IGNORED: Final = {
    *("pattern", "patternProperties", "format"),  # a regular expression cannot be stopped
    *("unevaluatedItems", "unevaluatedProperties", "$dynamicRef"),  # go through all keywords anew
    "uniqueItems",  # compares each item with each
}
TYPES: Final = Draft202012Validator.TYPE_CHECKER.redefine_many(
    {
        "array": lambda _, value: isinstance(value, list),
        "integer": lambda _, value: isinstance(value, int) and not isinstance(value, bool),
        "number": lambda _, value: (
            isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        ),
    }
)

Rule = Callable[[Any, Any, Any, Any], Iterator[ValidationError]]


class SchemaCheck:
    """Checks values against one schema.

    Args:
        schema: What ``parsed`` returned.
    """

    def __init__(self, schema: Schema) -> None:
        self._left = 0
        rules = {
            name: self._counted(name, rule)
            for name, rule in Draft202012Validator.VALIDATORS.items()
            if name not in IGNORED
        }
        # Without a meta-schema, $id and $anchor mean nothing: a reference is a path in the schema.
        kind = validators.create({}, validators=rules, type_checker=TYPES)
        self._validator = kind(_brief(schema), registry=Registry())

    def error_in(self, value: object, name: str) -> str:
        """Return the first error in a value: its place and what is wrong; empty if there is none.

        Args:
            value: The value; the arrays in it are tuples or lists.
            name: The name of the value, with which its place begins.

        Raises:
            UnusableSchema: A part that is needed for the check is no schema, or it takes too long.
        """
        self._left = MAX_STEPS
        try:
            error = next(self._validator.iter_errors(_brief(value)), None)
            if error is None:
                return ""
            error = best_match([error])
        except RecursionError:
            raise UnusableSchema("its references have no end") from None
        except UnusableSchema:
            raise
        except Exception:  # the library expects a schema that is right
            raise UnusableSchema("a type in it is not JSON Schema") from None
        place = ".".join([name, *map(str, error.absolute_path)])
        return f"{place}: {error.message:.200}"

    def _counted(self, name: str, rule: Rule) -> Rule:
        def counted(kind: Any, wanted: Any, value: Any, schema: Any) -> Iterator[ValidationError]:
            self._left -= 1 + _length(wanted) + _length(value)
            if self._left < 0:
                raise UnusableSchema(f"checking a message takes more than {MAX_STEPS} steps")
            if name == "additionalProperties" and "patternProperties" in schema:
                return  # it would search the names for the patterns
            if name == "type" and isinstance(value, bytes) and schema.get("format") == "binary":
                value = ""
            try:
                yield from rule(kind, wanted, value, schema) or ()
            except (UnusableSchema, RecursionError):
                raise
            except Exception:  # the library expects a schema that is right
                raise UnusableSchema(f"{name} = {wanted!r:.100} is not JSON Schema") from None

        return counted


def _length(value: object) -> int:
    return len(value) if isinstance(value, dict | list) else 0


class _Map(dict[Any, Any]):
    def __repr__(self) -> str:
        return _BRIEF.repr(self)


class _List(list[Any]):
    def __repr__(self) -> str:
        return _BRIEF.repr(self)


class _Text(str):
    __slots__ = ()

    def __repr__(self) -> str:
        return _BRIEF.repr(self)


class _Bytes(bytes):
    def __repr__(self) -> str:
        return _BRIEF.repr(self)


class _Brief(reprlib.Repr):
    """Abbreviates values, of which ``jsonschema`` writes each into an error, whatever its size."""

    def repr1(self, x: Any, level: int) -> str:
        """Return the text of a value: of its first items, and of the ends of a long text."""
        if isinstance(x, dict):
            return self.repr_dict(x, level)
        if isinstance(x, list):
            return self.repr_list(x, level)
        if isinstance(x, str):
            return self.repr_str(x, level)
        return repr(bytes(x[:20])) if isinstance(x, bytes) else super().repr1(x, level)


_BRIEF: Final = _Brief()


def _brief(value: object) -> Any:
    """Return a copy of a value that is abbreviated where it is written."""
    if isinstance(value, dict):
        return _Map((_brief(name), _brief(each)) for name, each in value.items())
    if isinstance(value, list | tuple):
        return _List(map(_brief, value))
    if isinstance(value, str):
        return _Text(value)
    return _Bytes(value) if isinstance(value, bytes) else value
