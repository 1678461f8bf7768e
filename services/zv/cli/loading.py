"""Builds the commands from the registries of services and tools.

Only the settings model of the requested command is loaded, and its code only when it is called.
"""

from __future__ import annotations

import importlib
import logging
import signal
from collections.abc import Callable
from typing import Any

import click

from zenoh_vision.cli.command import Command, Group
from zenoh_vision.cli.errors import leave_on_signals, log_to_stderr
from zenoh_vision.cli.flags import (
    CONFIG,
    DEBUG,
    JSON,
    ConnectionSettings,
    ToolConnectionSettings,
    connection_from,
    parameters_of,
    sections,
)
from zenoh_vision.cli.processors import ProcessorSettings
from zenoh_vision.cli.service import service_command
from zenoh_vision.config.settings import Settings, load_settings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host.signals import SIGNALS
from zenoh_vision.transport.connection import Connection
from zv.registry import BY_COMMAND, FILE_COMMANDS, SERVICES, imported, model_of
from zv.tools.registry import GROUPS, TOOLS
from zv.tools.shared.options import ToolOptions
from zv.tools.shared.output import Output

UP_TEXT = """Start a whole system from one file: the router and every node, each in its own process.

Checks the options of all nodes first. Shows a table of the nodes on a terminal, else plain lines.
A node that dies is restarted; Ctrl-C ends everything. Ends too when all nodes have ended, or one
that the file calls required: with status 0, or that of the node that did not end with 0."""


def load(name: str) -> click.Command:
    """Return a command of ``zv``."""
    if name == "up":
        return _up()
    if name in BY_COMMAND:
        return _service(name)
    if name in FILE_COMMANDS:
        return _on_files(name)
    return _group(name) if name in GROUPS else _tool(name)


def _service(name: str) -> Command:
    service = BY_COMMAND[name]
    entry = SERVICES[service]

    def loop() -> Callable[[Settings, Connection], object]:
        run: Callable[..., object] = importlib.import_module(f"zv.{service}.service").run
        if service == "router":
            return lambda settings, connection: run(
                settings, connection.zenoh_config, connection.credentials
            )
        return run

    def run_alone(settings: Settings, options: Settings) -> None:
        assert entry.alone is not None
        imported(entry.alone[1])(settings, options)

    return service_command(
        name,
        model_of(service),
        loop,
        entry.summary,
        entry.example.splitlines(),
        alone=(imported(entry.alone[0]), run_alone) if entry.alone else None,
    )


def _on_files(name: str) -> Command:
    entry = FILE_COMMANDS[name]
    model, options_model = model_of(entry.service), imported(entry.options)

    def call(*, debug: bool, config: str | None, **flags: Any) -> None:
        leave_on_signals()
        log_to_stderr(debug)
        limits = {each: flags.pop(each) for each in ProcessorSettings.model_fields}
        load_settings(ProcessorSettings, flags=limits).apply()
        given = {each: flags.pop(each) for each in options_model.model_fields}
        options = load_settings(options_model, flags=given)
        settings = load_settings(model, flags=flags, config=config)
        importlib.import_module(f"zv.{entry.service}.files").run(settings, options)

    headings = {
        "Files": [*parameters_of(options_model), DEBUG],
        "Options": [*parameters_of(model), CONFIG],
        "Processors": parameters_of(ProcessorSettings),
    }
    text = "\n\n".join(filter(None, (entry.summary, entry.details)))
    return Command(name, call, headings, text, entry.example.splitlines())


def _up() -> Command:
    model = imported("zv.launcher.options:UpOptions")
    examples = ["zv up", "zv up my-system.toml", "zv up --remap front=left --namespace robot1"]
    return Command("up", _run_up, sections(parameters_of(model)), UP_TEXT, examples)


def _run_up(*, debug: bool, **flags: Any) -> int:
    from zv.launcher.launch_file import read_launch_file, remapped_cameras
    from zv.launcher.options import UpOptions
    from zv.launcher.starting import launch_file, start

    log_to_stderr(debug)
    own = {name: flags.pop(name) for name in UpOptions.model_fields}
    options = load_settings(UpOptions, flags=own)
    if flags["connect"] and options.listen:
        raise ConfigurationError("--connect uses a running router, --listen starts one: give one")
    plan = read_launch_file(launch_file(options.file), remapped_cameras(options.remap))
    given = load_settings(
        ConnectionSettings, flags=flags, inline=plan.connection, inline_place=plan.place
    )
    own_router = bool(options.listen) or "connect" not in given.model_fields_set
    return start(plan, given.connection(), options, own_router=own_router, debug=debug)


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
    """Run a tool, then ignore signals, so that they no longer change the exit status."""
    try:
        run(options, connection, output)
    finally:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
