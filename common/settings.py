"""Flags, environment, TOML file and defaults, in that order, into one validated object.

A service's options are the fields of one model, and no other place lists them: the flags, the
environment variables, the check of the TOML file, ``configs/*.toml`` and docs/configuration.md
are derived from it.
"""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, cast

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
)
from pydantic.fields import FieldInfo

from common.errors import ConfigurationError
from common.keys import DEFAULT_CAMERA, NAME

if TYPE_CHECKING:
    from pydantic_settings import BaseSettings

CameraName = Annotated[str, Field(pattern=f"^{NAME.pattern}$", max_length=64)]
Text = Annotated[str, BeforeValidator(lambda value: str(value) if type(value) is int else value)]
"""A text that TOML may also spell as a number: ``source = 0``."""


def _from_text(value: object, info: ValidationInfo) -> object:
    if isinstance(value, (bool, float)):  # which a choice would take for a number it equals
        raise ValueError("Input should be a whole number")
    typed = bool(info.context and info.context["typed"])
    return int(value) if isinstance(value, str) and value.isdecimal() and not typed else value


FromText = BeforeValidator(_from_text)
"""Lets a choice of numbers be spelled as text, as flags and the environment do; not in TOML."""


@dataclass(frozen=True, slots=True)
class Secret:
    """Marks an option that must not stand in a command line, which everybody can read."""


class Settings(BaseModel):
    """Base of a set of options. Each has a default, a description, and a range if any."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    env_prefix: ClassVar[str]
    """What its environment variables start with; empty if the environment sets none of them."""

    env_shared: ClassVar[bool] = False
    """Whether other variables may start with that too; else they are taken for mistakes."""


S = TypeVar("S", bound=Settings)


class ServiceSettings(Settings):
    """Base of the options of a service that belongs to a camera."""

    camera: Annotated[CameraName, Field(description="camera this node belongs to")] = DEFAULT_CAMERA


def load_settings(
    model: type[S],
    *,
    flags: Mapping[str, object] | None = None,
    config: str | Path | None = None,
    inline: Mapping[str, object] | None = None,
    inline_place: str = "",
) -> S:
    """Merge all sources of a set of options and check each where it comes from.

    Of the environment only variables with the model's prefix count, and empty ones do not.

    Args:
        model: The service's options.
        flags: Given on the command line; None values were not given.
        config: TOML file.
        inline: The ``settings`` table of a node in a launch file; goes over ``config``.
        inline_place: How to name that table in an error.

    Raises:
        ConfigurationError: Naming the place, the option, its value and what is allowed.
    """
    layers: list[tuple[str, dict[str, Any], bool]] = []
    if config is not None:
        layers.append((str(config), read_toml(config), True))
    if inline:
        layers.append((inline_place, dict(inline), True))
    layers.append(("environment", from_environment(model), False))
    given = {name: value for name, value in (flags or {}).items() if value is not None}
    layers.append(("command line", given, False))
    merged: dict[str, Any] = {}
    for place, values, typed in layers:
        _check(model, place, values, strict=typed)
        merged |= values
    try:
        return model.model_validate(merged)
    except ValidationError as error:  # a rule about several options at once
        places = " and ".join(place for place, values, _ in layers if values)
        first = error.errors()[0]
        message = first["msg"].removeprefix("Value error, ")
        if first["type"] == "missing":
            raise ConfigurationError(f"{first['loc'][0]} must be given") from None
        raise ConfigurationError(f"{places}: {message}") from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        ConfigurationError: It cannot be read, or is not TOML; says where.
    """
    try:
        with Path(path).open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: not TOML: {error}") from None


def from_environment(model: type[Settings]) -> dict[str, Any]:
    """Return the options that the environment sets, as text.

    Raises:
        ConfigurationError: A variable with the model's prefix names no option.
    """
    prefix = model.env_prefix
    if not prefix:
        return {}
    for variable, value in os.environ.items():
        name = variable.removeprefix(prefix).lower()
        mistaken = variable.startswith(prefix) and name not in model.model_fields
        if mistaken and value and not model.env_shared:
            raise ConfigurationError(f"environment: {unknown(variable, name, model)}")
    from pydantic_settings import EnvSettingsSource  # takes as long as all else of a --help

    # It asks a model for its fields and their names only, which any model has.
    source = EnvSettingsSource(
        cast("type[BaseSettings]", model), env_prefix=prefix, env_ignore_empty=True
    )
    return source()


def unknown(shown: str, name: str, model: type[BaseModel]) -> str:
    """Say that a key is unknown, with the nearest that is known."""
    hint = meant(name, model.model_fields)
    return f"unknown key {shown!r}{hint or ';'} allowed: {', '.join(model.model_fields)}"


def meant(name: str, known: Iterable[str]) -> str:
    """Return a question with the nearest name that is known; nothing if none is near."""
    near = difflib.get_close_matches(name, known, 1)
    return f"; did you mean {near[0]!r}?" if near else ""


def allowed(field: FieldInfo, name: str, model: type[BaseModel]) -> str:
    """Say in words what an option may be, from its schema."""
    schema = properties(model)[name]
    kinds = [schema, *schema.get("anyOf", [])]
    words = []
    for kind in kinds:
        if "enum" in kind:
            words.append("one of " + ", ".join(map(str, kind["enum"])))
        elif "const" in kind:
            words.append(f"{kind['const']}")
        elif kind.get("type") == "null":
            continue
        elif "type" in kind:
            words.append(_range(kind))
    unset = field.is_required() or field.default in (None, ())
    default = "" if unset else f"; default {field.default!r}"
    return " or ".join(words) + default


def choices(name: str, model: type[BaseModel]) -> list[str]:
    """Return what an option may be where that is a list, as one types it; else nothing."""
    schema = properties(model)[name]
    kinds = [schema, *schema.get("anyOf", [])]
    return [str(value) for kind in kinds for value in kind.get("enum", [])]


@cache
def properties(model: type[BaseModel]) -> dict[str, Any]:
    """Return the schemas of a model's fields: made for all at once, and asked for one by one."""
    properties: dict[str, Any] = model.model_json_schema()["properties"]
    return properties


def _range(kind: Mapping[str, Any]) -> str:
    names = {
        "integer": "a whole number",
        "number": "a number",
        "string": "a text",
        "array": "a list",
    }
    word = names.get(kind["type"], "true or false" if kind["type"] == "boolean" else kind["type"])
    low, high = kind.get("minimum"), kind.get("maximum")
    if "exclusiveMinimum" in kind:
        word += f" above {kind['exclusiveMinimum']:g}"
    if high is None and kind["type"] == "integer" and "exclusiveMaximum" in kind:
        high = kind["exclusiveMaximum"] - 1
    if low is not None and high is not None:
        word += f" from {low:.12g} to {high:.12g}"
    elif low is not None:
        word += f" of at least {low:.12g}"
    elif high is not None:
        word += f" up to {high:.12g}"
    if high is None and "exclusiveMaximum" in kind:
        word += f"{' and' if low is not None else ''} below {kind['exclusiveMaximum']:g}"
    if "pattern" in kind:
        word += f" of the form {kind['pattern']}"
    if "maxLength" in kind:
        word += f" of at most {kind['maxLength']} characters"
    return word


def _check(model: type[Settings], place: str, values: Mapping[str, Any], *, strict: bool) -> None:
    """Check each value alone, so that the error can name the place it came from."""
    for name in values:
        if name not in model.model_fields:
            raise ConfigurationError(f"{place}: {unknown(name, name, model)}")
    try:
        model.model_validate(values, strict=strict, context={"typed": strict})
    except ValidationError as error:
        wrong = [e for e in error.errors(include_url=False) if e["type"] != "missing"]
        if not wrong or not wrong[0]["loc"]:
            return  # a rule about several options: judged when they are merged
        first = wrong[0]
        name = str(first["loc"][0])
        shown = f"{model.env_prefix}{name.upper()}" if place == "environment" else name
        shown = f"--{name.rstrip('_').replace('_', '-')}" if place == "command line" else shown
        message = first["msg"].removeprefix("Value error, ")
        raise ConfigurationError(
            f"{place}: {shown} = {values[name]!r} is not allowed ({message}); "
            f"allowed: {allowed(model.model_fields[name], name, model)}"
        ) from None
