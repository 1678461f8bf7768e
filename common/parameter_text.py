"""Parameters as text for people and for TOML: what they are, what they may be."""

from __future__ import annotations

import json

from common.messages import Parameter, ParameterList


def plain(value: bool | int | float | str | None) -> str:
    """Return a value as one types it behind ``NAME=``."""
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


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
