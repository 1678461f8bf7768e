"""``zv``: the commands and what loads them. Imports neither cv2 nor zenoh nor any service."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from common.errors import VisionError

COMMANDS = {
    "up": ("services.cli.up", "Start a whole system from one file, and watch it."),
    "router": ("services.cli.services", "Run the Zenoh router that is built in."),
    "camera": (
        "services.cli.services",
        "Publish a camera, a video, a folder or a synthetic scene.",
    ),
    "tracker": ("services.cli.services", "Publish the largest moving object of each frame."),
    "edge": ("services.cli.services", "Publish the edge map of each frame."),
}
"""Command, the module whose ``commands`` holds it, and its line in ``zv --help``."""


class LazyGroup(TyperGroup):
    """Loads the module of a command when that command is called, not before."""

    listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        """Return all names."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
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
