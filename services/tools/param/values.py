"""Values of parameters as text: from the command line, for people, and for TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

from common.errors import ConfigurationError
from common.messages import Parameter, ParameterList

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


def plain(value: bool | int | float | str | None) -> str:
    """Return a value as one types it behind ``NAME=``."""
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def shown(value: bool | int | float | str | None) -> str:
    """Return a value as it stands in a sentence."""
    return "not set" if value is None else plain(value) or '""'


def toml_line(parameter: Parameter) -> str:
    """Return a parameter's line in a TOML file; a comment if it is not set."""
    if parameter.value is None:
        return f"# {parameter.name} ="
    # JSON's escapes are TOML's too; but it leaves this one character bare, which TOML does not.
    value = json.dumps(parameter.value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return f"{parameter.name} = {value}"


def may_be(parameter: Parameter) -> str:
    """Say in a few words what a parameter may be."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.choices is not None:
        words = ", ".join(parameter.choices)
    elif low is not None and high is not None:
        words = f"{low:.12g} to {high:.12g}"
    elif parameter.type == "bool":
        words = "true, false"
    else:
        words = {"str": "text", "int": "whole number", "float": "number"}.get(
            parameter.type, parameter.type
        )
        words += "" if low is None else f" from {low:.12g}"
        words += "" if high is None else f" up to {high:.12g}"
    return f"{words}, or not set" if parameter.default is None else words


def described(parameter: Parameter) -> list[str]:
    """Return some lines with all there is to say of a parameter."""
    facts = [parameter.type, may_be(parameter), parameter.unit or ""]
    return [
        toml_line(parameter),
        f"    {parameter.description}",
        f"    {'; '.join(filter(None, facts))}; default {shown(parameter.default)}",
    ]


def toml_file(found: ParameterList) -> str:
    """Return the file that ``--config`` reads and ``zv param load`` sends."""
    lines = [
        f"# Parameters of {found.node}, revision {found.revision}; for --config, and for",
        f"# zv param load {found.node} FILE.toml",
    ]
    for parameter in found.parameters:
        unit = f"; {parameter.unit}" if parameter.unit else ""
        words = " ".join(parameter.description.split())
        lines += ["", f"# {words}; {may_be(parameter)}{unit}", toml_line(parameter)]
    return "\n".join(lines) + "\n"
