"""Flags made from a model's fields, so that no option is written down twice."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import typer
from pydantic import Field
from pydantic.fields import FieldInfo
from rich.markup import escape

from common.keys import DEFAULT_NAMESPACE, NAME
from common.session import DEFAULT_ENDPOINT, Connection
from common.settings import Settings, allowed, load_settings

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


def connection_from(flags: dict[str, Any]) -> Connection:
    """Take the connection's flags out of a command's, and return what they say."""
    own = {name: flags.pop(name, None) for name in ConnectionSettings.model_fields}
    settings = load_settings(ConnectionSettings, flags=own)
    return Connection(
        connect=settings.connect,
        namespace=settings.namespace,
        zenoh_config=settings.zenoh_config,
        timeout_s=settings.timeout,
    )


def flag(name: str) -> str:
    """Return an option's spelling on the command line."""
    return f"--{name.replace('_', '-')}"


def parameters_of(model: type[Settings], panel: str) -> list[inspect.Parameter]:
    """Return a typer parameter for each field of a model.

    Values stay text: the model itself judges them, wherever they come from.
    """
    return [_parameter(model, name, field, panel) for name, field in model.model_fields.items()]


def _parameter(model: type[Settings], name: str, field: FieldInfo, panel: str) -> inspect.Parameter:
    words = f"{field.description} ({allowed(field, name, model)})"
    words = escape(words) + f" \\[env: {model.env_prefix}{name.upper()}]"
    if field.annotation is bool:
        spelling = f"{flag(name)}/--no-{name.replace('_', '-')}"
        annotation: Any = Annotated[
            bool | None,
            typer.Option(spelling, help=words, rich_help_panel=panel, show_default=False),
        ]
    else:
        annotation = Annotated[
            str | None,
            typer.Option(
                flag(name),
                help=words,
                metavar=name.upper(),
                rich_help_panel=panel,
                show_default=False,
            ),
        ]
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=NOT_GIVEN, annotation=annotation
    )


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


def common_parameters(*, config: bool = True) -> list[inspect.Parameter]:
    """Return the flags that every command has."""
    found = parameters_of(ConnectionSettings, "Connection")
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


def log_to_stderr(debug: bool) -> None:
    """Send the log to standard error, one line an entry."""
    logging.basicConfig(
        level=logging.DEBUG if debug else logging.INFO,
        format="%(asctime)s %(levelname)-7s %(name)s: %(message)s",
        datefmt="%H:%M:%S",
    )
