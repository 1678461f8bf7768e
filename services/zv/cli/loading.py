"""Builds the commands from the registries of services and tools.

Only the settings model of the command at hand is loaded, and its code only when it is called.
"""

from __future__ import annotations

import importlib
import logging
import signal
from collections.abc import Callable
from typing import Any

import click

from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host.lifeline import end_with_parent
from zenoh_vision.host.signals import SIGNALS
from zenoh_vision.transport.connection import Connection
from zv.cli.command import Command, Group
from zv.cli.errors import leave_on_signals, log_to_stderr
from zv.cli.flags import (
    CONFIG,
    JSON,
    ConnectionSettings,
    ToolConnectionSettings,
    completer,
    connection_from,
    parameters_of,
    sections,
)
from zv.registry import BY_COMMAND, SERVICES, imported, model_of
from zv.tools.registry import GROUPS, TOOLS
from zv.tools.shared.options import ToolOptions
from zv.tools.shared.output import Output

UP_TEXT = """Start a whole system from one file: the router and every node, each in its own process.

Checks the options of all nodes first. Shows a table of the nodes on a terminal, else plain lines.
A node that dies is restarted; Ctrl-C ends everything."""


def load(name: str) -> click.Command:
    """Return a command of ``zv``."""
    if name == "up":
        return _up()
    if name in BY_COMMAND:
        return _service(name)
    return _group(name) if name in GROUPS else _tool(name)


def _service(name: str) -> Command:
    service = BY_COMMAND[name]
    model = model_of(service)

    def call(*, debug: bool, config: str | None, **flags: Any) -> None:
        leave_on_signals()
        end_with_parent()
        log_to_stderr(debug)
        connection = connection_from(flags)
        settings = load_settings(model, flags=flags, config=config)
        run = importlib.import_module(f"zv.{service}.service").run
        run(settings, connection.zenoh_config if service == "router" else connection)

    options = [*parameters_of(model), CONFIG]
    entry = SERVICES[service]
    return Command(name, call, sections(options), entry.summary, [entry.example])


def _up() -> Command:
    options = [
        click.Argument(
            ["file"],
            metavar="[FILE.toml]",
            shell_complete=completer(),
            required=False,
            help="launch file; default: configs/up.toml, or the built-in one",
        ),
        click.Option(
            ["--listen"],
            metavar="ENDPOINT",
            help="endpoint on which the router listens; overrides the file",
        ),
        click.Option(["--plain"], is_flag=True, help="plain lines, on a terminal too"),
    ]
    return Command("up", _run_up, sections(options), UP_TEXT, ["zv up configs/two-cameras.toml"])


def _run_up(*, file: str | None, listen: str | None, plain: bool, debug: bool, **flags: Any) -> int:
    from zv.launcher.launch_file import read_launch_file
    from zv.launcher.starting import launch_file, start

    log_to_stderr(debug)
    if flags["connect"] and listen:
        raise ConfigurationError("--connect uses a running router, --listen starts one: give one")
    plan = read_launch_file(launch_file(file))
    given = load_settings(
        ConnectionSettings, flags=flags, inline=plan.connection, inline_place=plan.place
    )
    own_router = bool(listen) or "connect" not in given.model_fields_set
    return start(
        plan, given.connection(), listen=listen, own_router=own_router, plain=plain, debug=debug
    )


def _group(name: str) -> Group:
    tools = {words.split()[1]: words for words in TOOLS if words.startswith(f"{name} ")}
    first = next(iter(tools.values()))
    return Group(
        name,
        GROUPS[name],
        {member: TOOLS[words].summary for member, words in tools.items()},
        lambda member: _tool(tools[member]),
        TOOLS[first].example.splitlines(),
    )


def _tool(words: str) -> Command:
    tool = TOOLS[words]
    model: type[ToolOptions] = imported(tool.options)
    connection_model = ConnectionSettings if tool.waits else ToolConnectionSettings

    def call(*, debug: bool, json: bool = False, **flags: Any) -> None:
        leave_on_signals()
        log_to_stderr(debug, logging.WARNING)
        connection = connection_from(flags, connection_model)
        options = load_settings(model, flags=flags)
        run_tool(imported(tool.run), options, connection, Output(as_json=json))

    options = [*parameters_of(model), *([JSON] if tool.json else [])]
    text = "\n\n".join(filter(None, (tool.summary, tool.details)))
    name = words.rpartition(" ")[2]
    return Command(name, call, sections(options, connection_model), text, tool.example.splitlines())


def run_tool(
    run: Callable[[ToolOptions, Connection, Output], None],
    options: ToolOptions,
    connection: Connection,
    output: Output,
) -> None:
    """Run a tool; after it, signals no longer change the exit status."""
    try:
        run(options, connection, output)
    finally:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
