"""Flags made from a model's fields, so that no option is written down twice."""

from __future__ import annotations

import inspect
import logging
import os
import signal
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, get_origin

import typer
from pydantic import Field
from pydantic.fields import FieldInfo
from rich.markup import escape

from common.connection import DEFAULT_ENDPOINT, Connection
from common.keys import DEFAULT_NAMESPACE, NAME
from common.settings import Settings, allowed, choices, load_settings
from common.signals import SIGNALS
from services.cli.logs import LogLine
from services.tools.options import Argument, Letter

NOT_GIVEN: Any = None


class ConnectionSettings(Settings):
    """Where the router is: the options that every command has."""

    env_prefix: ClassVar[str] = "ZV_"
    env_shared: ClassVar[bool] = True

    connect: Annotated[
        str,
        Field(
            pattern=r"^(tcp|tls|udp|quic|ws|unixsock-stream)/.+$",
            description="Zenoh endpoint of the router",
        ),
    ] = DEFAULT_ENDPOINT
    namespace: Annotated[
        str, Field(pattern=f"^{NAME.pattern}$", description="first chunk of every key expression")
    ] = DEFAULT_NAMESPACE
    zenoh_config: Annotated[
        str | None,
        Field(
            description="Zenoh's own JSON5 configuration file, for TLS and the like; endpoints "
            "that it states go over --connect and --listen"
        ),
    ] = None
    timeout: Annotated[
        float | None,
        Field(gt=0, le=86400, description="seconds to wait for a router; not set: for ever"),
    ] = None


class ToolConnectionSettings(ConnectionSettings):
    """The same for tools, which do not wait for ever."""

    timeout: Annotated[
        float | None, Field(gt=0, le=86400, description="seconds to wait for a router")
    ] = 5.0


def connection_from(
    flags: dict[str, Any], model: type[ConnectionSettings] = ConnectionSettings
) -> Connection:
    """Take the connection's flags out of a command's, and return what they say."""
    own = {name: flags.pop(name, None) for name in model.model_fields}
    settings = load_settings(model, flags=own)
    return Connection(
        connect=settings.connect,
        namespace=settings.namespace,
        zenoh_config=settings.zenoh_config,
        timeout_s=settings.timeout,
    )


def flag(name: str) -> str:
    """Return an option's spelling on the command line; ``for_`` is ``--for``."""
    return f"--{name.rstrip('_').replace('_', '-')}"


def parameters_of(model: type[Settings], panel: str) -> list[inspect.Parameter]:
    """Return a typer parameter for each field of a model.

    Values stay text: the model itself judges them, wherever they come from.
    """
    return [_parameter(model, name, field, panel) for name, field in model.model_fields.items()]


def _parameter(model: type[Settings], name: str, field: FieldInfo, panel: str) -> inspect.Parameter:
    words = field.description or ""
    if field.annotation is not bool or model.env_prefix:
        words += f" ({allowed(field, name, model)})"
    words = escape(words)
    if model.env_prefix:
        words += f" \\[env: {model.env_prefix}{name.upper()}]"
    looks: dict[str, Any] = {"help": words, "rich_help_panel": panel, "show_default": False}
    default = NOT_GIVEN
    kind: Any = list[str] if get_origin(field.annotation) is tuple else str
    marks = {type(mark): mark for mark in field.metadata}
    if Argument in marks:
        given = typer.Argument(
            metavar=marks[Argument].metavar,
            autocompletion=_completion(choices(name, model)),
            **looks,
        )
        if field.is_required():
            default = inspect.Parameter.empty
    elif field.annotation is bool:
        kind = bool
        given = typer.Option(_switch(model, name, field), **looks)
    else:
        letter = [f"-{marks[Letter].letter}"] if Letter in marks else []
        metavar = name.rstrip("_").upper()
        given = typer.Option(
            flag(name),
            *letter,
            metavar=metavar,
            autocompletion=_completion(choices(name, model)),
            **looks,
        )
        if field.is_required():
            default = inspect.Parameter.empty
    if default is NOT_GIVEN:
        kind = kind | None
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, given]
    )


def _completion(values: list[str]) -> Callable[..., list[str]] | None:
    """Return what a shell is told of an option's values, if they are a list."""

    def complete(incomplete: str) -> list[str]:
        return [value for value in values if value.startswith(incomplete)]

    return complete if values else None


def _switch(model: type[Settings], name: str, field: FieldInfo) -> str:
    """Return the flags of a yes-or-no option: both, if the environment may say the other."""
    yes, no = flag(name), f"--no-{flag(name)[2:]}"
    if model.env_prefix:
        return f"{yes}/{no}"
    return f" /{no}" if field.default else yes


def command(
    name: str, run: Callable[..., None], parameters: list[inspect.Parameter], words: str
) -> Any:
    """Return a typer command whose flags are these parameters; ``run`` gets them by name."""

    def call(**flags: Any) -> None:
        run(**flags)

    call.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    call.__doc__ = words
    single = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    single.command(name, help=words)(call)
    return typer.main.get_command(single)


def common_parameters(
    model: type[ConnectionSettings] = ConnectionSettings, *, config: bool = True
) -> list[inspect.Parameter]:
    """Return the flags that every command has."""
    found = parameters_of(model, "Connection")
    if config:
        found.append(
            inspect.Parameter(
                "config",
                inspect.Parameter.KEYWORD_ONLY,
                default=NOT_GIVEN,
                annotation=Annotated[
                    str | None,
                    typer.Option("--config", metavar="FILE.toml", help="options from a TOML file"),
                ],
            )
        )
    return [*found, debug_parameter()]


def debug_parameter() -> inspect.Parameter:
    """Return ``--debug``."""
    return inspect.Parameter(
        "debug",
        inspect.Parameter.KEYWORD_ONLY,
        default=False,
        annotation=Annotated[bool, typer.Option("--debug", help="log more, with tracebacks")],
    )


def leave_on_signals() -> None:
    """End at a signal while nothing is open that must be closed: until a node catches them.

    An exception would come out of whatever happens to run, some of which swallows or wraps it.
    """
    for number in SIGNALS:
        signal.signal(number, lambda _number, _at: os._exit(0))


def log_to_stderr(debug: bool, level: int = logging.INFO) -> None:
    """Send the log to standard error, one line an entry."""
    handler = logging.StreamHandler()
    handler.setFormatter(LogLine(debug=debug))
    logging.basicConfig(level=logging.DEBUG if debug else level, handlers=[handler])
