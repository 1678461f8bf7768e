"""Click parameters made from the fields of settings models, so that no option is written twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_origin

import click
from click.shell_completion import CompletionItem
from pydantic import Field

from zenoh_vision.cli.command import Sections
from zenoh_vision.config.constraints import choices, help_words, is_duration, schema_of
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.settings import (
    CONNECTION,
    NAME_FORM,
    Argument,
    Letter,
    LocalPath,
    Settings,
    flag_of,
    load_settings,
    read_config,
)
from zenoh_vision.keys import DEFAULT_NAMESPACE, NAME
from zenoh_vision.transport.connection import DEFAULT_ENDPOINT, Connection
from zenoh_vision.transport.endpoint_option import Endpoint


class ConnectionSettings(Settings):
    """The options for the connection to the router, which every command has."""

    env_prefix: ClassVar[str] = "ZV_"
    env_shared: ClassVar[bool] = True

    connect: Annotated[Endpoint, Field(description="Zenoh endpoint of the router")] = (
        DEFAULT_ENDPOINT
    )
    namespace: Annotated[
        str,
        Field(pattern=f"^{NAME.pattern}$", description="first chunk of every key expression"),
        NAME_FORM,
    ] = DEFAULT_NAMESPACE
    zenoh_config: Annotated[
        str | None,
        Field(
            description="Zenoh's JSON5 configuration file, for settings of Zenoh; endpoints in it "
            "override --connect and --listen"
        ),
        LocalPath(),
    ] = None
    credentials: Annotated[
        str | None,
        Field(
            description="certificate, key and rights, a file of zv security; without --connect, "
            "the endpoint in it is used"
        ),
        LocalPath(),
    ] = None
    timeout: Annotated[
        float | None,
        Field(gt=0, le=86400, description="how long to wait for a router; not set: forever"),
        SECONDS,
    ] = None

    def connection(self) -> Connection:
        """Return the options in the form that the library uses."""
        return Connection(
            connect=self.connect,
            namespace=self.namespace,
            zenoh_config=self.zenoh_config,
            credentials=self.credentials,
            timeout_s=self.timeout,
            any_namespace="namespace" not in self.model_fields_set,
        )


class ToolConnectionSettings(ConnectionSettings):
    """The connection options of tools, which do not wait forever."""

    timeout: Annotated[
        float | None, Field(gt=0, le=86400, description="how long to wait for a router"), SECONDS
    ] = 5.0


def completer(values: Sequence[str] = ()) -> Callable[..., list[str | CompletionItem]]:
    """Return the function that completes a value: from a list, else from file names."""

    def complete(
        _context: click.Context, _parameter: click.Parameter, incomplete: str
    ) -> list[str | CompletionItem]:
        if not values:
            return [CompletionItem(incomplete, type="file")]
        return [value for value in values if value.startswith(incomplete)]

    return complete


CONFIG = click.Option(
    ["--config"],
    metavar="FILE.toml",
    shell_complete=completer(),
    help="options from a TOML file",
)
DEBUG = click.Option(["--debug"], is_flag=True, help="log more, with the tracebacks of bugs")
JSON = click.Option(["--json"], is_flag=True, help="print JSON, one object per line")


def sections(
    options: Sequence[click.Parameter], connection: type[ConnectionSettings] = ConnectionSettings
) -> Sections:
    """Return a command's parameters by section: its own, and those of every command."""
    return {"Options": [*options, DEBUG], "Connection": parameters_of(connection)}


def connection_from(
    flags: dict[str, Any],
    model: type[ConnectionSettings] = ConnectionSettings,
    config: str | Path | None = None,
) -> Connection:
    """Take the connection's flags out of a command's, and return the connection.

    Flags and environment override the table ``connection`` of the service's file ``config``.
    """
    own = {name: flags.pop(name, None) for name in model.model_fields}
    table = {} if config is None else read_config(config)[1]
    settings = load_settings(
        model,
        flags=own,
        inline=table,
        inline_place=f"{config}: [{CONNECTION}]",
        inline_folder=Path(config or "").parent,
    )
    return settings.connection()


def parameters_of(model: type[Settings]) -> list[click.Parameter]:
    """Return a Click parameter for each field of a model; its value is None if it is not given."""
    return [_parameter(model, name) for name in model.model_fields]


def _parameter(model: type[Settings], name: str) -> click.Parameter:
    field = model.model_fields[name]
    text = field.description or ""
    is_switch = schema_of(model, name).get("type") == "boolean"
    if not is_switch or model.env_prefix:
        text += _in_brackets(help_words(model, name))
    if model.env_prefix:
        text += f" [env: {model.env_prefix}{name.upper()}]"
    marks = {type(mark): mark for mark in field.metadata}
    letters = [f"-{marks[Letter].letter}"] if Letter in marks else []
    if is_switch:
        return _switch(model, name, text, letters)
    several = get_origin(field.annotation) is tuple
    attributes: dict[str, Any] = {
        # The environment or a file may set what no flag does; ``load_settings`` tells.
        "required": field.is_required() and not model.env_prefix,
        "help": text,
        "shell_complete": completer(choices(model, name)),
        "callback": lambda _context, _parameter, value: None if value == () else value,
    }
    if Argument in marks:
        metavar = marks[Argument].metavar
        metavar = metavar if field.is_required() else f"[{metavar}]"
        metavar += "..." if several else ""
        return click.Argument([name], metavar=metavar, nargs=-1 if several else 1, **attributes)
    names = [name, flag_of(name), *letters]
    metavar = "DURATION" if is_duration(model, name) else name.rstrip("_").upper()
    return click.Option(names, metavar=metavar, multiple=several, **attributes)


def _in_brackets(words: str) -> str:
    return f" ({words})" if words else ""


def _switch(model: type[Settings], name: str, text: str, letters: list[str]) -> click.Option:
    """Return the option of a boolean field: two flags, if the environment may set the opposite."""
    yes = flag_of(name)
    no = f"--no-{yes[2:]}"
    if model.env_prefix:
        return click.Option([name, f"{yes}/{no}"], is_flag=True, default=None, help=text)
    value = not model.model_fields[name].default
    names = [name, yes if value else no, *letters]
    return click.Option(names, flag_value=value, default=None, help=text)
