"""Values of parameters as text: from the command line, for people, and for TOML."""

from __future__ import annotations

import re
from collections.abc import Iterable

from common.errors import ConfigurationError
from common.messages import Parameter
from common.parameter_text import may_be, plain, toml_line

YES = {"true", "yes", "on", "1"}
NO = {"false", "no", "off", "0"}


def assignments(texts: Iterable[str]) -> dict[str, str]:
    """Return names and values of texts such as ``quality=60``.

    Raises:
        ConfigurationError: One has another form, or a name comes twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator or not name:
            raise ConfigurationError(f"{text!r} is no NAME=VALUE; allowed: such as quality=60")
        if name in found:
            raise ConfigurationError(f"{name} is given twice; allowed: once")
        found[name] = value
    return found


def value_of(parameter: Parameter, text: str) -> object:
    """Return what a text means as the value of a parameter.

    A text that means nothing stays text: the node itself says then what is wrong with it.
    """
    if not text and parameter.default is None:
        return None
    if parameter.type == "bool" and text.lower() in YES | NO:
        return text.lower() in YES
    try:
        if parameter.type == "int" and re.fullmatch(r"[+-]?[0-9]+", text):
            return int(text)
        return float(text) if parameter.type == "float" else text
    except ValueError:
        return text


def shown(value: bool | int | float | str | None) -> str:
    """Return a value as it stands in a sentence."""
    return "not set" if value is None else plain(value) or '""'


def described(parameter: Parameter) -> list[str]:
    """Return some lines with all there is to say of a parameter."""
    facts = [parameter.type, may_be(parameter), parameter.unit or ""]
    return [
        toml_line(parameter),
        f"    {parameter.description}",
        f"    {'; '.join(filter(None, facts))}; default {shown(parameter.default)}",
    ]
