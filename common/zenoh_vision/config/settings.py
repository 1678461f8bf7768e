"""Settings: command line flags, environment, TOML file and defaults merged into one model.

The options of a service are the fields of one model, and no other place lists them: flags,
environment variables, the checks of TOML files, ``configs/*.toml`` and docs/configuration.md are
derived from it.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, ValidationInfo

from zenoh_vision.config.constraints import (
    Form,
    allowed_and_default,
    reason,
    schema_of,
    unknown_key,
    wrong_values,
)
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.keys import DEFAULT_CAMERA, NAME

NAME_FORM = Form("letters a-z, digits and _")
CameraName = Annotated[str, Field(pattern=f"^{NAME.pattern}$", max_length=64), NAME_FORM]
ALL_CAMERAS = "*"
CameraNames = Annotated[
    str,
    Field(pattern=r"^([a-z0-9_]+(,[a-z0-9_]+)*|\*)$", max_length=1000),
    Form("letters a-z, digits and _; several separated by commas; or *"),
]
"""One camera, several, or all: ``front``, ``front,left``, ``*``."""

Text = Annotated[str, BeforeValidator(lambda value: str(value) if type(value) is int else value)]
"""A text that may be written as a number in TOML: ``source = 0``."""


def _from_text(value: object, info: ValidationInfo) -> object:
    if isinstance(value, (bool, float)):  # a choice would accept True as 1
        raise ValueError("not a whole number")
    typed = bool(info.context and info.context["typed"])
    return int(value) if isinstance(value, str) and value.isdecimal() and not typed else value


FromText = BeforeValidator(_from_text)
"""Accepts text for a choice of numbers, as flags and the environment give it; not in TOML."""


@dataclass(frozen=True, slots=True)
class Secret:
    """Marks an option that must not be put on a command line, which every user can read."""


@dataclass(frozen=True, slots=True)
class Argument:
    """Marks an option that is a positional argument instead of a flag; a tuple takes any number."""

    metavar: str


@dataclass(frozen=True, slots=True)
class Letter:
    """Marks an option that has a short flag too, given without its dash."""

    letter: str


@dataclass(frozen=True, slots=True)
class Shared:
    """Marks an option that several programs have, set for all of them by one variable.

    The variable with a program's own prefix overrides it.
    """

    variable: str


class Settings(BaseModel):
    """Base of a set of options. Each has a default, a description, and a range if any."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    env_prefix: ClassVar[str] = ""
    """Prefix of its environment variables; empty if the environment sets none of them."""

    env_shared: ClassVar[bool] = False
    """Whether other programs use variables with this prefix; if not, an unknown one is an error."""


S = TypeVar("S", bound=Settings)


class ServiceSettings(Settings):
    """Base of the options of a service that belongs to a camera."""

    camera: Annotated[CameraName, Field(description="camera this node belongs to")] = DEFAULT_CAMERA


def cameras_of(names: str) -> tuple[str, ...]:
    """Return the cameras of a ``CameraNames``, each once; none for ``*``, all cameras."""
    return () if names == ALL_CAMERAS else tuple(dict.fromkeys(names.split(",")))


def flag_of(name: str) -> str:
    """Return the flag of an option: ``--stall-after``; ``for_`` is ``--for``."""
    return f"--{name.rstrip('_').replace('_', '-')}"


def option_name(model: type[BaseModel], name: str) -> str:
    """Return the name of an option on the command line: ``--rate``, or ``KEY`` of an argument."""
    marks = (mark for mark in model.model_fields[name].metadata if isinstance(mark, Argument))
    return next((mark.metavar for mark in marks), flag_of(name))


def load_settings(
    model: type[S],
    *,
    flags: Mapping[str, object] | None = None,
    config: str | Path | None = None,
    inline: Mapping[str, object] | None = None,
    inline_place: str = "",
) -> S:
    """Merge all sources of a set of options, and check each value at the source it comes from.

    Args:
        model: The options.
        flags: Values from the command line; None means not given.
        config: TOML file.
        inline: The ``settings`` table of a node in a launch file; overrides ``config``.
        inline_place: The name of that table in errors.

    Raises:
        SourceError: The file cannot be opened.
        ConfigurationError: Names the source, the option, its value and what is allowed.
    """
    sources: list[tuple[str, dict[str, Any], bool]] = []
    if config is not None:
        sources.append((str(config), read_toml(config), True))
    if inline:
        sources.append((inline_place, dict(inline), True))
    sources.append(("environment", from_environment(model), False))
    given = {name: value for name, value in (flags or {}).items() if value is not None}
    sources.append(("command line", given, False))
    merged: dict[str, Any] = {}
    for place, values, typed in sources:
        _check(model, place, values, typed=typed)
        merged |= values
    try:
        return model.model_validate(merged)
    except ValidationError as error:  # each value is right: a rule about several of them
        first = error.errors()[0]
        if first["type"] == "missing":
            raise ConfigurationError(f"{first['loc'][0]} must be given") from None
        places = " and ".join(place for place, values, _ in sources if values)
        raise ConfigurationError(f"{places}: {reason(first)}") from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        SourceError: It cannot be opened or read.
        ConfigurationError: It is not TOML; says where.
    """
    try:
        with Path(path).open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: not TOML: {error}") from None


def from_environment(model: type[Settings]) -> dict[str, Any]:
    """Return the options that the environment sets, as text; lists and tables from JSON.

    Only variables with the model's prefix count. An empty variable is not set.

    Raises:
        ConfigurationError: A variable with the model's prefix names no option.
    """
    prefix = model.env_prefix
    found: dict[str, Any] = {
        name: os.environ[mark.variable]
        for name, field in model.model_fields.items()
        for mark in field.metadata
        if isinstance(mark, Shared) and prefix and os.environ.get(mark.variable)
    }
    for variable, text in os.environ.items() if prefix else ():
        if not variable.startswith(prefix) or not text:
            continue
        name = variable.removeprefix(prefix).lower()
        if name in model.model_fields:
            found[name] = text
            if schema_of(model, name).get("type") in ("array", "object"):
                with suppress(ValueError):  # text stays text: the check says what is allowed
                    found[name] = json.loads(text)
        elif not model.env_shared:
            raise ConfigurationError(f"environment: {unknown_key(variable, name, model)}")
    return found


def variable_of(model: type[Settings], name: str) -> str:
    """Return the environment variable that currently sets an option: its own, or a shared one."""
    own = f"{model.env_prefix}{name.upper()}"
    marks = (mark for mark in model.model_fields[name].metadata if isinstance(mark, Shared))
    shared = next((mark.variable for mark in marks), own)
    return own if os.environ.get(own) else shared


def _check(model: type[Settings], place: str, values: Mapping[str, Any], *, typed: bool) -> None:
    """Check the values of one source, so that the error can name it; TOML is typed, not text."""
    for name in values:
        if name not in model.model_fields:
            raise ConfigurationError(f"{place}: {unknown_key(name, name, model)}")

    def shown(name: str) -> str:
        if place == "environment":
            return variable_of(model, name)
        return option_name(model, name) if place == "command line" else name

    try:
        model.model_validate(values, strict=typed, context={"typed": typed})
    except ValidationError as error:
        # A rule about several options is judged when all sources are merged.
        for name, words in wrong_values(values, error, shown).items():
            raise ConfigurationError(
                f"{place}: {words}; allowed: {allowed_and_default(model, name)}"
            ) from None
