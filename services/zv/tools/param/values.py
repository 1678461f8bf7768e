"""Parameters and their values as texts: parses what the user types, and formats output."""

from __future__ import annotations

import re
from collections.abc import Iterable

from zenoh_vision.config.constraints import limits, plain, toml_line
from zenoh_vision.config.parameter_groups import table_of
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.messages import Parameter

TRUE = {"true", "yes", "on", "1"}
FALSE = {"false", "no", "off", "0"}
NIL = "nil"
"""The name of an unset value in a refusal, as on the wire."""


def assignments(texts: Iterable[str]) -> dict[str, str]:
    """Return the names and values in texts such as ``quality=60``, or ``quality`` and ``60``.

    Raises:
        ConfigurationError: A text has another form, or a name occurs twice.
    """
    found: dict[str, str] = {}
    rest = iter(texts)
    for text in rest:
        name, separator, value = text.partition("=")
        if not separator:
            behind = next(rest, None)
            value, separator = (behind or "", "" if behind is None else " ")
        if not separator or not name:
            raise ConfigurationError(
                f"{text!r} is not NAME=VALUE; allowed: such as quality=60, or quality 60"
            )
        if name in found:
            raise ConfigurationError(f"{name} is given twice; allowed: once")
        found[name] = value
    return found


def value_of(parameter: Parameter, text: str) -> object:
    """Return the value of a text by the parameter's type.

    A text that is not such a value is returned unchanged, so that the node reports the error.
    """
    if text in ("", NIL) and parameter.default is None and table_of(parameter.name) is None:
        return None
    if parameter.type == "bool" and text.lower() in TRUE | FALSE:
        return text.lower() in TRUE
    try:
        if parameter.type == "int" and re.fullmatch(r"[+-]?[0-9]+", text):
            return int(text)
        return float(text) if parameter.type == "float" else text
    except ValueError:
        return text


def described(parameter: Parameter) -> list[str]:
    """Return a parameter's value, meaning, type, range, unit and default as lines of text."""
    facts = [parameter.type, limits(parameter), parameter.unit or "", *(parameter.flags or ())]
    return [
        toml_line(parameter.name, parameter.value),
        f"    {parameter.description}",
        f"    {'; '.join(filter(None, facts))}; default {shown(parameter.default)}",
    ]


def shown(value: bool | int | float | str | None) -> str:
    """Return a value as text, also one that is not set."""
    return "not set" if value is None else plain(value) or '""'
