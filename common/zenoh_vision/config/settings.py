"""Settings: command line flags, environment, TOML file and defaults merged into one model.

The options of a service are the fields of one model, and no other place lists them: flags,
environment variables, the checks of TOML files, ``configs/*.toml`` and docs/configuration.md are
derived from it.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, ValidationInfo

from zenoh_vision.config.constraints import (
    Form,
    allowed_and_default,
    mark_of,
    reason,
    schema_of,
    unknown_key,
    wrong_values,
)
from zenoh_vision.error_text import shortened
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


@dataclass(frozen=True, slots=True)
class LocalPath:
    """Marks an option that names a file or folder of this machine.

    In a file, it is relative to that file; elsewhere, to the working directory.

    Attributes:
        names_path: Tells of a value whether it is a path, for an option that takes others too.
        is_made: The program makes it, so it need not exist.
    """

    names_path: Callable[[str], bool] = lambda _value: True
    is_made: bool = False


class Settings(BaseModel):
    """Base of a set of options. Each has a default, a description, and a range if any."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    env_prefix: ClassVar[str] = ""
    """Prefix of its environment variables; empty if the environment sets none of them."""

    env_shared: ClassVar[bool] = False
    """Whether other programs use variables with this prefix; if not, an unknown one is an error."""


S = TypeVar("S", bound=Settings)

CONNECTION: Final = "connection"
"""The table of a service's file with the options of its connection."""


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
    mark = mark_of(model, name, Argument)
    return flag_of(name) if mark is None else mark.metavar


def load_settings(
    model: type[S],
    *,
    flags: Mapping[str, object] | None = None,
    config: str | Path | None = None,
    inline: Mapping[str, object] | None = None,
    inline_place: str = "",
    inline_folder: Path = Path(),
    inline_wins: bool = False,
) -> S:
    """Merge all sources of a set of options, and check each value at the source it comes from.

    Args:
        model: The options.
        flags: Values from the command line; None means not given.
        config: TOML file.
        inline: A table of a launch file; overrides ``config``.
        inline_place: The name of that table in errors.
        inline_folder: The folder of the launch file, to which its paths are relative.
        inline_wins: Whether that table overrides the environment too.

    Raises:
        SourceError: The file cannot be opened.
        ConfigurationError: Names the source, the option, its value and what is allowed.
    """
    sources: list[tuple[str, dict[str, Any], bool]] = []
    if config is not None:
        values = _from_folder(model, read_config(config)[0], Path(config).parent)
        sources.append((str(config), values, True))
    sources.append(("environment", from_environment(model), False))
    if inline:
        values = _from_folder(model, inline, inline_folder)
        sources.insert(len(sources) - (not inline_wins), (inline_place, values, True))
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


def local_path(
    model: type[BaseModel], name: str, value: object, *, must_exist: bool = False
) -> str | None:
    """Return the path that an option's value is; None if it is none.

    With ``must_exist``, also None for one that the program makes.
    """
    mark = mark_of(model, name, LocalPath) if name in model.model_fields else None
    if mark and mark.is_made and must_exist:
        return None
    return value if mark and isinstance(value, str) and mark.names_path(value) else None


def _from_folder(
    model: type[BaseModel], values: Mapping[str, object], folder: Path
) -> dict[str, Any]:
    """Return the values of a file, with its relative paths relative to the working directory."""
    paths = {name: local_path(model, name, value) for name, value in values.items()}
    return {**values, **{name: str(folder / path) for name, path in paths.items() if path}}


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        SourceError: It cannot be opened or read.
        ConfigurationError: It is not TOML; says where.
    """
    try:
        # Editors on Windows begin a file with a byte order mark, which is not TOML.
        return tomllib.loads(Path(path).read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: not TOML: {error}") from None


def read_config(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a service's TOML file; return its options, and those in the table ``connection``.

    Raises:
        SourceError: It cannot be opened or read.
        ConfigurationError: It is not TOML, or ``connection`` is no table.
    """
    values = read_toml(path)
    connection = values.pop(CONNECTION, {})
    if not isinstance(connection, dict):
        raise ConfigurationError(
            f"{path}: {CONNECTION} = {shortened(connection)} is not allowed; allowed: a table "
            f"[{CONNECTION}]"
        )
    return values, connection


def from_environment(model: type[Settings]) -> dict[str, Any]:
    """Return the options that the environment sets, as text; lists and tables from JSON.

    Only variables with the model's prefix count. An empty variable is not set.

    Raises:
        ConfigurationError: A variable with the model's prefix names no option.
    """
    prefix = model.env_prefix
    found: dict[str, Any] = {
        name: os.environ[mark.variable]
        for name in model.model_fields
        if (mark := mark_of(model, name, Shared)) and prefix and os.environ.get(mark.variable)
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
    mark = mark_of(model, name, Shared)
    return own if mark is None or os.environ.get(own) else mark.variable


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
