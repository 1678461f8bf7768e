"""Writes configs/*.toml, and the tables of pages in docs/, from options, commands and metrics.

A page holds its text; what stands between ``<!-- begin NAME -->`` and ``<!-- end NAME -->`` is
replaced. Run it with ``make configs``. A test checks that the files are up to date.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path

import click
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from zenoh_vision.cli.command import Command, Group
from zenoh_vision.cli.errors import FAULT_STATUS
from zenoh_vision.cli.flags import ConnectionSettings, ToolConnectionSettings, parameters_of
from zenoh_vision.cli.processors import ProcessorSettings
from zenoh_vision.config.constraints import allowed, toml_line, toml_value
from zenoh_vision.config.parameters import live_fields
from zenoh_vision.config.settings import Settings, flag_of
from zenoh_vision.errors import PayloadError, VisionError
from zv.cli.main import COMMANDS, load, section
from zv.launcher.launch_tables import LaunchTables, NodeTable, RouterTable
from zv.registry import SERVICES, command_of, model_of
from zv.tools.doctor.remedies import REMEDIES
from zv.tools.metrics.families import FAMILIES

ROOT = Path(__file__).parents[1]
WIDTH = 96
IN_CONTAINERS = ("camera", "tracker", "edge", "viewer", "recorder")
"""Services whose options docker-compose.yml passes on."""


def files() -> dict[Path, str]:
    """Return every generated file and its text."""
    found = {ROOT / "configs" / f"{service}.toml": config_file(service) for service in SERVICES}
    compose = ROOT / "docker-compose.yml"
    found[compose] = with_block(
        compose.read_text(), "# begin settings\n", "# end settings", anchors()
    )
    blocks = {
        "configuration.md": {"options": options(), "launch file": launch_file_keys()},
        "cli.md": {"commands": commands()},
        "metrics.md": {"metrics": metrics()},
        "doctor.md": {"remedies": remedies()},
    }
    for name, of_page in blocks.items():
        path = ROOT / "docs" / name
        page = path.read_text(encoding="utf-8")
        for block, text in of_page.items():
            begin, end = (f"<!-- {word} {block} -->" for word in ("begin", "end"))
            page = with_block(page, f"{begin}\n", end, f"\n{text}\n")
        found[path] = page
    return found


def with_block(page: str, begin: str, end: str, text: str) -> str:
    """Return a page with the text between two marks replaced."""
    before, _, rest = page.partition(begin)
    return before + begin + text + end + rest.partition(end)[2]


# docker-compose.yml


def anchors() -> str:
    """Return a YAML anchor for each service in a container, with the names of its variables."""
    text = ""
    for service in IN_CONTAINERS:
        model = model_of(service)
        names = ", ".join(f"{model.env_prefix}{name.upper()}" for name in model.model_fields)
        lines = textwrap.wrap(f"{{ {names} }}", WIDTH, break_on_hyphens=False)
        text += f"x-{service}: &{service}\n" + "".join(f"  {line}\n" for line in lines)
    return text


# configs/*.toml


def config_file(service: str) -> str:
    """Return a service's TOML file: every option with its default, meaning and range."""
    model = model_of(service)
    live = live_fields(model)
    lines = [
        f"# Options of `zv {command_of(service)}` and their defaults. Made by `make configs`.",
        f"# A flag ({flag_of('name')}) and the environment ({model.env_prefix}NAME) override it.",
    ]
    if live:
        lines.append("# Options marked live can be changed while the node runs: `zv param --help`.")
    # Tables come last: what follows the head of a table belongs to it.
    for name, field in sorted(model.model_fields.items(), key=lambda item: item[1].default == {}):
        words = f"{field.description}; {allowed(model, name)}"
        if field.default is None:
            words += "; not set by default"
        words += "; live" if name in live else ""
        comment = textwrap.wrap(words, WIDTH, break_long_words=False, break_on_hyphens=False)
        line = f"[{name}]" if field.default == {} else toml_line(name, field.default)
        lines += ["", *(f"# {each}" for each in comment), line]
    return "\n".join(lines) + "\n"


# docs/configuration.md


def options() -> str:
    """Return the tables of all options."""
    parts = [
        _options("Every command", ConnectionSettings),
        "A [tool](tools.md) waits 5 s for a router unless `--timeout` says otherwise.\n",
        _options("Every service", ProcessorSettings),
        *(_options(f"`zv {command_of(service)}`", model_of(service)) for service in SERVICES),
    ]
    return "\n".join(parts)


def launch_file_keys() -> str:
    """Return the tables of the keys of a launch file."""
    parts = [
        _keys("Top level", LaunchTables),
        _keys("`[router]`", RouterTable),
        _keys("`[[node]]`, one for each process", NodeTable),
    ]
    return "\n".join(parts)


def _options(title: str, model: type[Settings]) -> str:
    live = live_fields(model)
    rows = []
    for name, field in model.model_fields.items():
        row = [f"`{flag_of(name)}`", f"`{model.env_prefix}{name.upper()}`"]
        row += [_default(field), allowed(model, name)]
        if name in live:
            effect = live[name].effect
            row += [live[name].unit or "", f"yes; {effect}" if effect else "yes"]
        elif live:
            row += ["", "no"]
        rows.append([*row, field.description or ""])
    titles = ["flag", "environment", "default", "allowed", *(["unit", "live"] if live else [])]
    return f"## {title}\n\n" + _table([*titles, "meaning"], rows)


def _keys(title: str, model: type[BaseModel]) -> str:
    fields = model.model_fields.items()
    rows = [[f"`{name}`", _default(field), field.description or ""] for name, field in fields]
    return f"### {title}\n\n" + _table(["key", "default", "meaning"], rows)


def _default(field: FieldInfo) -> str:
    """Return a default as it is written in TOML."""
    if field.is_required():
        return "required"
    if field.default in (None, {}) or isinstance(field.default, BaseModel):
        return "not set"
    return f"`{toml_value(field.default)}`"


# docs/cli.md

SHARED: dict[str, type[Settings]] = {
    "Connection": ConnectionSettings,
    "Connection of tools": ToolConnectionSettings,
    "Processors": ProcessorSettings,
}
"""The options that many commands have, so they are listed once."""


def entries() -> dict[str, Command | Group]:
    """Return every command by its command line, each group before its commands."""
    return dict(each for name in COMMANDS for each in _below(f"zv {name}", load(name)))


def _below(words: str, command: click.Command) -> Iterator[tuple[str, Command | Group]]:
    assert isinstance(command, Command | Group)
    yield words, command
    if isinstance(command, Group):
        for member in command.commands:
            yield from _below(f"{words} {member}", command.load(member))


def commands() -> str:
    """Return the contents, the exit statuses, and the text of each command."""
    found = entries()
    parts = [_contents(found), "## Exit status\n", _statuses()]
    shared = {_parameters(parameters_of(model)): title for title, model in SHARED.items()}
    parts += [f"## {title}\n\n{table}" for table, title in shared.items()]
    parts += [_chapter(words, command, shared) for words, command in found.items()]
    return "\n".join(parts)


def _contents(found: dict[str, Command | Group]) -> str:
    rows: dict[str, list[list[str]]] = {}
    for words, command in found.items():
        row = [f"[{words}](#{_anchor(words)})", _escaped((command.help or "").splitlines()[0])]
        rows.setdefault(section(words.split()[1]), []).append(row)
    parts = [f"**{title}**\n\n{_table(['command', 'what it does'], rows[title])}" for title in rows]
    return "\n".join(parts)


def _statuses() -> str:
    rows = [["0", "Success, or stopped by a signal."]]
    ours = [
        kind for kind in VisionError.__subclasses__() if kind.__module__ == "zenoh_vision.errors"
    ]
    for kind in sorted(ours, key=lambda kind: kind.exit_status):
        if kind.exit_status and kind is not PayloadError:
            rows.append([str(kind.exit_status), _escaped((kind.__doc__ or "").splitlines()[0])])
    rows.append([str(FAULT_STATUS), "A bug in zv; `--debug` shows the traceback."])
    return _table(["status", "meaning"], rows)


def _chapter(words: str, command: Command | Group, shared: dict[str, str]) -> str:
    level = "#" * len(words.split())
    paragraphs = [" ".join(text.split()) for text in (command.help or "").split("\n\n")]
    parts = [f"{level} {words}\n", *(f"{_escaped(text)}\n" for text in paragraphs)]
    parts.append("```sh\n" + "\n".join(command.examples) + "\n```\n")
    if isinstance(command, Group):
        names = [f"{words} {member}" for member in command.commands]
        return "\n".join([*parts, ", ".join(f"[{n}](#{_anchor(n)})" for n in names) + "\n"])
    usage = " ".join([words, *command.collect_usage_pieces(click.Context(command))])
    parts.append(f"```text\n{usage}\n```\n")
    tables = [_parameters(each) for each in command.sections.values()]
    parts += [table for table in tables if table not in shared]
    titles = [shared[table] for table in tables if table in shared]
    if titles:
        links = ", ".join(f"[{title}](#{_anchor(title)})" for title in titles)
        parts.append(f"Further options: {links}.\n")
    return "\n".join(parts)


def _parameters(parameters: Iterable[click.Parameter]) -> str:
    rows = [
        [_spelling(each), _escaped(each.help or "")]
        for each in parameters
        if isinstance(each, click.Option | click.Argument)
    ]
    return _table(["option", "meaning"], rows)


def _spelling(parameter: click.Option | click.Argument) -> str:
    if isinstance(parameter, click.Argument):
        return f"`{parameter.metavar}`"
    value = "" if parameter.is_flag else f" {parameter.metavar}"
    return ", ".join(f"`{name}{value}`" for name in (*parameter.opts, *parameter.secondary_opts))


# docs/metrics.md


def metrics() -> str:
    """Return the table of all metrics."""
    rows = [
        [f"`{each.name}`", each.kind, ", ".join(f"`{label}`" for label in each.labels), each.words]
        for each in FAMILIES
    ]
    return _table(["metric", "type", "labels", "meaning"], rows)


# docs/doctor.md


def remedies() -> str:
    """Return the table of the remedies for losses."""
    rows = []
    for reason, remedy in REMEDIES.items():
        of_camera = " of the camera" * remedy.of_camera
        parameter = f"`{remedy.parameter}`{of_camera}" if remedy.parameter else "-"
        rows.append([f"`{reason}`", remedy.words, parameter])
    return _table(["reason", "what to do", "parameter"], rows)


# Markdown


def _escaped(text: str) -> str:
    """Return a text escaped so that Markdown shows it unchanged."""
    for mark in ("\\", "*", "_", "<", "["):
        text = text.replace(mark, f"\\{mark}")
    return text


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _table(titles: list[str], rows: list[list[str]]) -> str:
    lines = [titles, ["---"] * len(titles), *rows]
    escaped = ([cell.replace("|", "\\|") for cell in line] for line in lines)
    return "".join(f"| {' | '.join(line)} |\n" for line in escaped)


if __name__ == "__main__":
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
