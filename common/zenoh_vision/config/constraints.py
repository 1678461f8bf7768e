"""Texts about options and parameters: allowed values, errors, and TOML lines.

The limits are read from the JSON Schema that pydantic derives from a model's fields. Help pages,
errors, ``configs/*.toml``, the documentation and ``zv param`` use these texts.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from zenoh_vision.error_text import printable, shortened, suggestion
from zenoh_vision.messages import Parameter, ParameterList

TYPES = {"boolean": "bool", "integer": "int", "number": "float", "string": "str"}
"""The type of a parameter by that of its JSON Schema."""

WORDS = {"bool": "true or false", "int": "a whole number", "float": "a number", "str": "a text"}

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

Value = bool | int | float | str | None


@cache
def _schemas(model: type[BaseModel]) -> dict[str, Any]:
    """Return the schemas of all fields at once: pydantic does not derive them one by one."""
    found: dict[str, Any] = model.model_json_schema()["properties"]
    return found


def schema_of(model: type[BaseModel], name: str) -> dict[str, Any]:
    """Return the JSON Schema of a field's values, without the null of an optional field."""
    schema: dict[str, Any] = _schemas(model)[name]
    return next((kind for kind in schema.get("anyOf", ()) if kind.get("type") != "null"), schema)


def choices(model: type[BaseModel], name: str) -> list[str]:
    """Return the values of an option that is a choice, as text; empty for any other."""
    schema = schema_of(model, name)
    return list(map(str, schema.get("enum") or ([schema["const"]] if "const" in schema else [])))


def bounds(schema: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value that a schema allows; None where it has no limit.

    Exclusive limits of floats are not included.
    """
    high = schema.get("maximum")
    if high is None and schema.get("type") == "integer" and "exclusiveMaximum" in schema:
        high = schema["exclusiveMaximum"] - 1
    return schema.get("minimum"), high


def allowed(model: type[BaseModel], name: str) -> str:
    """Return the allowed values of an option in words: ``a whole number from 1 to 100``."""
    listed = choices(model, name)
    if listed:
        return ("one of " if len(listed) > 1 else "") + ", ".join(listed)
    schema = schema_of(model, name)
    kind = schema.get("type", "")
    words = "a list" if kind == "array" else WORDS.get(TYPES.get(kind, ""), kind)
    low, high = bounds(schema)
    if "exclusiveMinimum" in schema:
        words += f" above {schema['exclusiveMinimum']:g}"
    if low is not None and high is not None:
        words += f" from {low:.12g} to {high:.12g}"
    elif low is not None:
        words += f" of at least {low:.12g}"
    elif high is not None:
        words += f" up to {high:.12g}"
    if high is None and "exclusiveMaximum" in schema:
        words += f"{' and' if low is not None else ''} below {schema['exclusiveMaximum']:g}"
    if "pattern" in schema:
        words += f" of the form {schema['pattern']}"
    if "maxLength" in schema:
        words += f" of at most {schema['maxLength']} characters"
    return words


def allowed_and_default(model: type[BaseModel], name: str) -> str:
    """Return the allowed values of an option, and its default unless that is "not set"."""
    field = model.model_fields[name]
    unset = field.is_required() or field.default in (None, ())
    return allowed(model, name) + ("" if unset else f"; default {field.default!r}")


def limits(parameter: Parameter) -> str:
    """Return the allowed values of a running node's parameter in short: ``1 to 100``."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.choices is not None:
        words = ", ".join(parameter.choices)
    elif low is not None and high is not None:
        words = f"{low:.12g} to {high:.12g}"
    elif parameter.type == "bool":
        words = "true, false"
    else:
        words = WORDS.get(parameter.type, parameter.type).removeprefix("a ")
        words += "" if low is None else f" from {low:.12g}"
        words += "" if high is None else f" up to {high:.12g}"
    return f"{words}, or not set" if parameter.default is None else words


def reason(error: ErrorDetails) -> str:
    """Return pydantic's error text, without the prefix that it adds to texts of validators."""
    return error["msg"].removeprefix("Value error, ")


def wrong_value(shown: str, value: object, error: ErrorDetails) -> str:
    """Return ``rate = 'x' is not allowed (Input should be a valid number)``."""
    return f"{shown} = {shortened(value)} is not allowed ({reason(error)})"


def wrong_values(
    values: Mapping[Any, object], error: ValidationError, shown: Callable[[str], str] = str
) -> dict[str, str]:
    """Return an error text for each option with a wrong value, by option.

    Empty if each value is valid alone, but their combination is not.

    Args:
        values: The validated values, by option.
        error: The error that the validation raised.
        shown: Returns an option's name as the user spelled it.
    """
    found: dict[str, str] = {}
    for each in error.errors(include_url=False):
        if each["loc"] and each["type"] != "missing":
            name = str(each["loc"][0])
            found.setdefault(name, wrong_value(shown(name), values.get(name), each))
    return found


def unknown_key(shown: str, name: str, model: type[BaseModel]) -> str:
    """Return the error text for a key that a model does not have, with the most similar valid key.

    Args:
        shown: The key as the user spelled it: with the prefix of an environment variable.
        name: The key as the model would spell it.
        model: Its fields are the allowed keys.
    """
    hint = suggestion(name, model.model_fields, after=" ")
    return f"unknown key {shortened(shown)}; {hint}allowed: {', '.join(model.model_fields)}"


def plain(value: Value) -> str:
    """Return a value as it is typed after ``NAME=``."""
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def toml_value(value: Value) -> str:
    """Return a value as TOML."""
    text = json.dumps(value, ensure_ascii=False)  # JSON's escapes are TOML's too
    return "".join(each if each.isprintable() else _toml_escape(each) for each in text)


def toml_key(name: str) -> str:
    """Return a name as TOML, quoted if it must be."""
    return name if BARE_KEY.fullmatch(name) else toml_value(name)


def toml_line(name: str, value: Value) -> str:
    """Return the line of an option in a TOML file; a comment if it is not set."""
    key = toml_key(name)
    return f"# {key} =" if value is None else f"{key} = {toml_value(value)}"


def toml_file(found: ParameterList) -> str:
    """Return a node's parameters as a file for ``--config`` and ``zv param load``."""
    node = printable(found.node)
    lines = [
        f"# Parameters of {node}, revision {found.revision}; for --config, and for",
        f"# zv param load {shlex.quote(node)} FILE.toml",
    ]
    for one in found.parameters:
        unit = f"; {one.unit}" if one.unit else ""
        words = " ".join(one.description.split())
        comment = printable(f"{words}; {limits(one)}{unit}")
        lines += ["", f"# {comment}", toml_line(one.name, one.value)]
    return "\n".join(lines) + "\n"


def _toml_escape(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
