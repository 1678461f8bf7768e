"""Writes configs/*.toml, docs/configuration.md and docs/cli.md from the options and commands.

``python -m services.cli.defaults``, or ``make configs``. A test holds the files to it.
"""

from __future__ import annotations

import json
import textwrap
from pathlib import Path

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from common.parameters import live_fields, mark_of
from common.settings import Settings, allowed
from services.catalogue import SERVICES, command_of, model_of
from services.cli.options import ConnectionSettings, flag
from services.cli.reference import reference
from services.launch_file import LaunchTables, NodeTable, RouterTable

ROOT = Path(__file__).parent.parent.parent
WIDTH = 96


def toml_of(service: str) -> str:
    """Return a service's TOML file: every option with its default, meaning and range."""
    model = model_of(service)
    lines = [
        f"# Options of `zv {command_of(service)}`, each with its default. Made by `make configs`.",
        f"# A flag ({flag('name')}) and the environment ({model.env_prefix}NAME) go over it.",
    ]
    if live_fields(model):
        lines.append("# What is live can change while the node runs: `zv param --help`.")
    for name, field in model.model_fields.items():
        words = f"{field.description}; {may_be(field, name, model)}"
        if field.default is None:
            words += "; not set by default"
        words += "; live" if mark_of(field) else ""
        comment = textwrap.wrap(words, WIDTH, break_long_words=False, break_on_hyphens=False)
        lines += ["", *(f"# {line}" for line in comment)]
        if field.default is None:
            lines.append(f"# {name} =")
        else:
            lines.append(f"{name} = {json.dumps(field.default)}")
    return "\n".join(lines) + "\n"


def may_be(field: FieldInfo, name: str, model: type[BaseModel]) -> str:
    """Say what an option may be, without its default."""
    return allowed(field, name, model).partition("; default ")[0]


def documentation() -> str:
    """Return docs/configuration.md."""
    parts = [
        "# Configuration\n",
        "Made by `make configs` from the options' models; do not edit.\n",
        "Each option can be given as a flag, as an environment variable, or in a TOML file "
        "(`--config FILE.toml`). A flag goes over the environment, that over the file, that over "
        "the default. An empty variable counts as not set. An unknown option is an error, "
        "exit status 2.\n",
        "An option that is live can change while the node runs, see "
        "[parameters.md](parameters.md).\n",
        options("Every command", ConnectionSettings),
        "A [tool](tools.md) waits 5 s for a router unless `--timeout` says otherwise.\n",
        *(options(f"`zv {command_of(service)}`", model_of(service)) for service in SERVICES),
        "## The launch file of `zv up`\n",
        "`zv up FILE.toml` checks every option of every node before it starts anything. For a "
        "node's options the order is: environment, `settings`, `config`, default. A variable such "
        "as `ZV_CAMERA_SOURCE` therefore holds for every camera in the file. `ZV_ROUTER_LISTEN`, "
        "`ZV_CONNECT`, `ZV_NAMESPACE` and the flags `--listen`, `--connect`, `--namespace` go "
        "over the file too. Files are looked for beside the launch file.\n",
        keys_of("Top level", LaunchTables),
        keys_of("`[router]`", RouterTable),
        keys_of("`[[node]]`, one for each process", NodeTable),
    ]
    return "\n".join(parts)


def options(title: str, model: type[Settings]) -> str:
    """Return the options of a model as a Markdown table."""
    rows = []
    for name, field in model.model_fields.items():
        variable = f"`{model.env_prefix}{name.upper()}`"
        words = [default_of(field), may_be(field, name, model)]
        words += live_words(field) if live_fields(model) else []
        rows.append([f"`{flag(name)}`", variable, *words, field.description or ""])
    titles = ["flag", "environment", "default", "allowed"]
    titles += ["unit", "live"] if live_fields(model) else []
    return f"## {title}\n\n" + markdown([*titles, "meaning"], rows)


def live_words(field: FieldInfo) -> list[str]:
    """Return an option's unit, and whether it is live and what a change does besides."""
    mark = mark_of(field)
    if mark is None:
        return ["", "no"]
    return [mark.unit or "", f"yes; {mark.effect}" if mark.effect else "yes"]


def keys_of(title: str, model: type[BaseModel]) -> str:
    """Return the keys of a table of the launch file as a Markdown table."""
    rows = [
        [f"`{name}`", default_of(field), field.description or ""]
        for name, field in model.model_fields.items()
    ]
    return f"### {title}\n\n" + markdown(["key", "default", "meaning"], rows)


def default_of(field: FieldInfo) -> str:
    """Return a default as one writes it in TOML."""
    if field.is_required():
        return "must be given"
    if field.default is None or isinstance(field.default, BaseModel):
        return "not set"
    return f"`{json.dumps(field.default)}`"


def markdown(titles: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [titles, ["---"] * len(titles), *rows]
    return "".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines
    )


def files() -> dict[Path, str]:
    """Return every generated file and its text."""
    found = {ROOT / "configs" / f"{service}.toml": toml_of(service) for service in SERVICES}
    found[ROOT / "docs" / "configuration.md"] = documentation()
    found[ROOT / "docs" / "cli.md"] = reference()
    return found


if __name__ == "__main__":
    for path, text in files().items():
        path.write_text(text)
