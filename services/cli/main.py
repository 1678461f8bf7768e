"""``zv``: the commands and what loads them. Imports neither cv2 nor zenoh nor any service."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import typer

from common.errors import VisionError
from services.catalogue import SERVICES
from services.cli.lazy import lazy
from services.tools.catalogue import GROUPS, TOOLS

COMMANDS = {
    "up": ("services.cli.up", "Start a whole system from one file, and watch it."),
    **{name: ("services.cli.services", service.line) for name, service in SERVICES.items()},
    **{name: ("services.cli.tools", line) for name, line in GROUPS.items()},
    **{words: ("services.cli.tools", TOOLS[words].line) for words in TOOLS if " " not in words},
}
"""Command, the module whose ``load`` makes it, and its line in ``zv --help``."""


def load(name: str) -> Any:
    """Return a command."""
    module, _ = COMMANDS[name]
    return importlib.import_module(module).load(name)


app = typer.Typer(
    name="zv",
    cls=lazy({name: line for name, (_, line) in COMMANDS.items()}, load),
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Cameras and vision on the network without ROS.",
    epilog="Example: zv up  |  zv camera --source 0 --rate 10  |  zv COMMAND --help",
)


@app.callback()
def _root() -> None:
    """Cameras and vision on the network without ROS."""


def main() -> None:
    """Run ``zv``; every error of ours is one line and its exit status."""
    try:
        app()
    except VisionError as error:
        if error.exit_status:
            print(f"zv: {error}", file=sys.stderr)
        sys.exit(error.exit_status)
    except KeyboardInterrupt:
        sys.exit(0)
