"""The commands of all tools, made from their entries in the catalogue."""

from __future__ import annotations

import importlib
import inspect
import logging
import os
import signal
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer

from common.connection import Connection
from common.settings import load_settings
from common.signals import SIGNALS
from services.cli.lazy import group
from services.cli.options import (
    ConnectionSettings,
    ToolConnectionSettings,
    command,
    common_parameters,
    connection_from,
    leave_on_signals,
    log_to_stderr,
    parameters_of,
)
from services.tools.catalogue import GROUPS, TOOLS, Tool
from services.tools.options import ToolOptions
from services.tools.output import Output

Run = Callable[[ToolOptions, Connection, Output], None]


def load(name: str) -> Any:
    """Return a tool's command, or the group of commands of that name."""
    return _group(name) if name in GROUPS else _command(name)


def _group(name: str) -> Any:
    """Return a command that has commands, none of which is loaded yet."""
    members = {
        words.removeprefix(f"{name} "): words for words in TOOLS if words.startswith(f"{name} ")
    }
    return group(
        name,
        GROUPS[name],
        {member: TOOLS[words].line for member, words in members.items()},
        lambda member: _command(members[member]),
        "\n\n".join(f"Example: {TOOLS[words].example}" for words in list(members.values())[:1]),
    )


def _command(words: str) -> Any:
    tool = TOOLS[words]
    model: type[ToolOptions] = _named(tool.options)
    text = "\n\n".join(filter(None, (tool.line, tool.details, f"Example: {tool.example}")))

    def call(*, debug: bool, json: bool = False, **flags: Any) -> None:
        leave_on_signals()
        log_to_stderr(debug, logging.WARNING)
        connection = connection_from(flags, _connection_model(tool))
        given = {name: None if value == [] else value for name, value in flags.items()}
        options = load_settings(model, flags=given)
        run_tool(_named(tool.run), options, connection, Output(as_json=json))

    return command(words.rpartition(" ")[2], call, _parameters(tool, model), text)


def run_tool(run: Run, options: ToolOptions, connection: Connection, output: Output) -> None:
    """Run a tool; an end of its reader is no error."""
    try:
        run(options, connection, output)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of `zv ... | head` has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    finally:
        for number in SIGNALS:  # one that comes now must not change the status
            signal.signal(number, signal.SIG_IGN)


def _parameters(tool: Tool, model: type[ToolOptions]) -> list[inspect.Parameter]:
    found = parameters_of(model, "Options")
    if tool.json:
        words = "print JSON, one object a line"
        found.append(
            inspect.Parameter(
                "json",
                inspect.Parameter.KEYWORD_ONLY,
                default=False,
                annotation=Annotated[
                    bool, typer.Option("--json", help=words, rich_help_panel="Options")
                ],
            )
        )
    return [*found, *common_parameters(_connection_model(tool), config=False)]


def _connection_model(tool: Tool) -> type[ConnectionSettings]:
    return ConnectionSettings if tool.waits else ToolConnectionSettings


def _named(place: str) -> Any:
    """Return what ``module:name`` stands for."""
    module, name = place.split(":")
    return getattr(importlib.import_module(module), name)
