"""``zv``: the commands and what loads them. Imports neither cv2 nor zenoh nor any service."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from common.errors import VisionError
from services.catalogue import SERVICES

COMMANDS = {
    "up": ("services.cli.up", "Start a whole system from one file, and watch it."),
    **{name: ("services.cli.services", service.line) for name, service in SERVICES.items()},
}
"""Command, the module whose ``commands`` holds it, and its line in ``zv --help``."""


class LazyGroup(TyperGroup):
    """Loads the module of a command when that command is called, not before."""

    listing = False

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - typer's signature
        """Return all names."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002 - typer's signature
        """Return a command; for the list of commands only its name and line."""
        if cmd_name not in COMMANDS:
            return None
        module, line = COMMANDS[cmd_name]
        if self.listing:
            return TyperCommand(cmd_name, help=line)
        return importlib.import_module(module).commands()[cmd_name]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help without loading any command."""
        self.listing = True
        super().format_help(ctx, formatter)


app = typer.Typer(
    name="zv",
    cls=LazyGroup,
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
