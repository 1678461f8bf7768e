"""``zv``: the commands and what loads them. Imports neither cv2 nor zenoh nor any service."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

import typer

from services.catalogue import BY_COMMAND, SERVICES
from services.cli.failures import tell, watch_threads
from services.cli.lazy import lazy
from services.cli.shells import VARIABLE, answer_shells
from services.tools.catalogue import GROUPS, TOOLS

COMMANDS = {
    "up": ("services.cli.up", "Start a whole system from one file, and watch it."),
    **{
        command: ("services.cli.services", SERVICES[name].line)
        for command, name in BY_COMMAND.items()
    },
    **{name: ("services.cli.tools", line) for name, line in GROUPS.items()},
    **{words: ("services.cli.tools", TOOLS[words].line) for words in TOOLS if " " not in words},
    "completion": ("services.cli.completion", "Print the completion script of a shell."),
}
"""Command, the module whose ``load`` makes it, and its line in ``zv --help``."""

INTERRUPTED = 130
MOST_TOOLS = 5
"""Of which ``zv`` alone shows an example."""


def load(name: str) -> Any:
    """Return a command."""
    module, _ = COMMANDS[name]
    return importlib.import_module(module).load(name)


def section(name: str) -> str:
    """Return the heading of a command in ``zv --help``."""
    if name == "up" or name in BY_COMMAND:
        return "Services"
    tools = [tool for words, tool in TOOLS.items() if words.split()[0] == name]
    return tools[0].section if tools else "Setting up"


def example(name: str) -> str:
    """Return a command line that shows a command's use, the shortest one if there is no other."""
    if name in BY_COMMAND:
        return one_by_one(SERVICES[BY_COMMAND[name]].example)[0]
    tools = [tool for words, tool in TOOLS.items() if words.split()[0] == name]
    return one_by_one(tools[0].example)[0] if tools else f"zv {name}"


def one_by_one(text: str) -> list[str]:
    """Return the command lines of an example, which stand beside one another in a help."""
    return [line.strip() for line in text.replace("  |  ", "\n").splitlines()]


def examples() -> str:
    """Return what stands below the commands: how one begins, and the first of the tools."""
    tools = [name for name in COMMANDS if section(name) == "Tools"]
    lines = [example(name) for name in ("up", "camera", *tools[:MOST_TOOLS])]
    lines.append("zv COMMAND --help")
    return "Examples:\n" + "\n".join(f"  {line}" for line in lines)


app = typer.Typer(
    name="zv",
    cls=lazy(
        {name: line for name, (_, line) in COMMANDS.items()},
        load,
        {name: section(name) for name in COMMANDS},
    ),
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Cameras and vision on the network without ROS.",
    epilog=examples(),
)


@app.callback()
def _root() -> None:
    """Cameras and vision on the network without ROS."""


def run() -> int:
    """Run the command that was typed and return its exit status."""
    status = app(prog_name="zv", standalone_mode=False)
    return status if isinstance(status, int) and status != INTERRUPTED else 0


def main() -> None:
    """Run ``zv``; every error is one line and its exit status."""
    debug = "--debug" in sys.argv[1:]
    watch_threads(debug=debug)
    if VARIABLE in os.environ:
        answer_shells()
    try:
        status = run()
    except KeyboardInterrupt:
        status = 0
    except Exception as error:
        status = tell(error, debug=debug)
    sys.exit(status)
