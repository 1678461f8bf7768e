"""Texts about options and parameters: allowed values, errors, and TOML lines.

The limits are read from the JSON Schema that pydantic derives from a model's fields. Help pages,
errors, ``configs/*.toml``, the documentation and ``zv param`` use these texts.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from zenoh_vision.config.durations import EXAMPLES, Duration, duration_text
from zenoh_vision.config.parameter_groups import table_of
from zenoh_vision.error_text import printable, shortened, suggestion
from zenoh_vision.messages import Parameter, ParameterList

TYPES = {"boolean": "bool", "integer": "int", "number": "float", "string": "str"}
"""The type of a parameter by that of its JSON Schema."""

WORDS = {"bool": "true or false", "int": "a whole number", "float": "a number", "str": "a text"}

SHORT_REASONS = {
    "less_than_equal": "above {le}",
    "less_than": "not below {lt}",
    "greater_than_equal": "below {ge}",
    "greater_than": "not above {gt}",
    "float_parsing": "not a number",
    "float_type": "not a number",
    "int_parsing": "not a whole number",
    "int_type": "not a whole number",
    "int_from_float": "not a whole number",
    "string_too_short": "empty",  # no option has another least length than 1
    "too_short": "empty",
    "string_pattern_mismatch": "",
    "literal_error": "",
}
"""What is wrong with a value, by pydantic's type of error, where its own text says no more."""

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

Value = bool | int | float | str | None

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Form:
    """Says in words which texts an option allows, for people who do not read regular expressions.

    Attributes:
        words: What help and errors show: ``tcp/HOST:PORT``.
    """

    words: str


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
        # An empty text alone is no word: it is written as in the default, with quotes.
        return ("one of " if len(listed) > 1 else "") + ", ".join(each or "''" for each in listed)
    schema = schema_of(model, name)
    if is_duration(model, name):
        return f"a duration such as {EXAMPLES}{_range(schema, duration_text, ',')}"
    kind = schema.get("type", "")
    words = "a list" if kind == "array" else WORDS.get(TYPES.get(kind, ""), kind)
    words += _range(schema, lambda number: f"{number:.12g}")
    form = form_words(model, name)
    if form:
        words = form
    elif "pattern" in schema:
        words += f" of the form {schema['pattern']}"
    if "maxLength" in schema:
        words += f"{',' if form else ' of'} at most {schema['maxLength']} characters"
    return words


def form_words(model: type[BaseModel], name: str) -> str:
    """Return in words which texts an option, or each of a list, allows; empty without ``Form``."""
    form = mark_of(model, name, Form)
    return "" if form is None else form.words


def _range(schema: Mapping[str, Any], shown: Callable[[float], str], separator: str = "") -> str:
    """Return the limits of a number in words, with a space in front; empty if there are none."""
    words = ""
    low, high = bounds(schema)
    if "exclusiveMinimum" in schema:
        words += f" above {schema['exclusiveMinimum']:g}"
    if low is not None and high is not None:
        words += f" from {shown(low)} to {shown(high)}"
    elif low is not None:
        words += f" of at least {shown(low)}"
    elif high is not None:
        words += f" up to {shown(high)}"
    if high is None and "exclusiveMaximum" in schema:
        words += f"{' and' if low is not None else ''} below {schema['exclusiveMaximum']:g}"
    return words and separator + words


def is_duration(model: type[BaseModel], name: str) -> bool:
    """Tell whether an option is a duration, whose value is a number of seconds."""
    return mark_of(model, name, Duration) is not None


def mark_of(model: type[BaseModel], name: str, kind: type[T]) -> T | None:
    """Return the mark of a type that an option, or each of a list, has; None if it has none."""
    field = model.model_fields[name]
    marks = list(field.metadata)
    if get_origin(field.annotation) is tuple:
        for item in get_args(field.annotation):
            marks += getattr(item, "__metadata__", ())
    return next((mark for mark in marks if isinstance(mark, kind)), None)


def allowed_and_default(model: type[BaseModel], name: str) -> str:
    """Return the allowed values of an option, and its default unless that is "not set"."""
    field = model.model_fields[name]
    unset = field.is_required() or field.default in (None, (), {})
    return allowed(model, name) + ("" if unset else f"; default {_default(model, name)}")


def help_words(model: type[BaseModel], name: str) -> str:
    """Return the text after an option's description in help: limits and default, if useful.

    That an option is a text or a list says nothing; a switch is on or off.
    """
    field = model.model_fields[name]
    schema = schema_of(model, name)
    if schema.get("type") == "boolean":
        return "" if field.default is None else f"default: {'on' if field.default else 'off'}"
    words = allowed(model, name)
    if is_duration(model, name):
        words = f"such as 500ms, 5s, 2m{_range(schema, duration_text, ';')}"
    elif words in ("a list", WORDS["str"]):
        words = ""
    unset = field.is_required() or field.default in (None, (), "", {})
    return "; ".join(filter(None, (words, "" if unset else f"default {_default(model, name)}")))


def _default(model: type[BaseModel], name: str) -> str:
    """Return the default of an option as it would be typed."""
    default = model.model_fields[name].default
    if is_duration(model, name):
        return duration_text(default)
    if isinstance(default, tuple):
        return ", ".join(map(repr, default))
    return plain(default) if isinstance(default, (bool, int, float)) else repr(default)


def limits(parameter: Parameter) -> str:
    """Return the allowed values of a running node's parameter in short: ``1 to 100``."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.choices is not None:
        words = ", ".join(parameter.choices)
    elif "read_only" in (parameter.flags or ()):
        return "only read"
    elif low is not None and high is not None:
        words = f"{low:.12g} to {high:.12g}"
    elif parameter.type == "bool":
        words = "true, false"
    else:
        words = WORDS.get(parameter.type, parameter.type).removeprefix("a ")
        words += "" if low is None else f" from {low:.12g}"
        words += "" if high is None else f" up to {high:.12g}"
    if parameter.step is not None:
        words += f" in steps of {parameter.step:.12g}"
    if parameter.default is None and table_of(parameter.name) is None:
        words += ", or not set"
    return words


def reason(error: ErrorDetails) -> str:
    """Return what is wrong in short: ``above 100``; the text of a validator without a prefix.

    Empty for a pattern or a choice: the allowed values, which follow in words, say all.
    """
    words = SHORT_REASONS.get(error["type"])
    if words is not None:
        return words.format(**{name: f"{limit:.12g}" for name, limit in _limits_in(error)})
    return error["msg"].removeprefix("Value error, ")


def _limits_in(error: ErrorDetails) -> Iterator[tuple[str, float]]:
    """Yield the limits of a number that an error is about, by the names that pydantic gives."""
    for name, limit in error.get("ctx", {}).items():
        if isinstance(limit, int | float):
            yield name, limit


def wrong_value(shown: str, value: object, error: ErrorDetails) -> str:
    """Return ``rate = 'x' is not allowed (not a number)``."""
    why = reason(error)
    return f"{shown} = {shortened(value)} is not allowed" + (f" ({why})" if why else "")


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
            match each["loc"][1:], values.get(name):
                case (int(place),), list() | tuple() as several:
                    value = several[place]
                case _, value:
                    pass
            found.setdefault(name, wrong_value(shown(name), value, each))
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
    # Tables come last: what follows the head of a table belongs to it.
    table = ""
    for one in sorted(found.parameters, key=lambda each: _table_of(each.name)):
        if _table_of(one.name) != table:
            table = _table_of(one.name)
            lines += ["", f"[{toml_key(table)}]"]
        unit = f"; {one.unit}" if one.unit else ""
        words = " ".join(one.description.split())
        comment = printable(f"{words}; {limits(one)}{unit}")
        key = one.name.partition(".")[2] or one.name
        line = toml_line(key, one.value)
        settable = NOT_LOADED.isdisjoint(one.flags or ()) or one.value is None
        lines += ["", f"# {comment}", line if settable else f"# {line}"]
    return "\n".join(lines) + "\n"


NOT_LOADED = frozenset({"read_only", "write_only", "inactive", "grabbed"})
"""Flags of parameters that a file would set in vain, or that have no value to keep."""


def _table_of(name: str) -> str:
    table = table_of(name)
    return table[0] if table else ""


def _toml_escape(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
