"""The entry point of ``zv``: runs the command of ``sys.argv`` and returns an exit status.

It loads neither cv2, zenoh nor any settings before a command is called.
"""

from __future__ import annotations

import os
import sys

import click
from click.shell_completion import get_completion_class

from zenoh_vision.cli.command import Command, Group, run_command
from zenoh_vision.cli.errors import exit_with_status
from zv.registry import BY_COMMAND, FILE_COMMANDS, SERVICES
from zv.tools.registry import GROUPS, TOOLS

COMMANDS = {
    "up": "Start and supervise a whole system from one file.",
    **{command: SERVICES[name].summary for command, name in BY_COMMAND.items()},
    **{command: entry.summary for command, entry in FILE_COMMANDS.items()},
    **GROUPS,
    **{words: tool.summary for words, tool in TOOLS.items() if " " not in words},
    "completion": "Print the completion script of a shell.",
}
"""The commands with their summaries."""

COMPLETION_VARIABLE = "_ZV_COMPLETE"
"""Variable with which the shells' scripts request completions; its value is the format."""

COMPLETION_TEXT = """Print the completion script of a shell.

For bash: zv completion bash > ~/.local/share/bash-completion/completions/zv

For zsh, in ~/.zshrc after compinit: eval "$(zv completion zsh)"

For fish: zv completion fish > ~/.config/fish/completions/zv.fish"""


def load(name: str) -> click.Command:
    """Return a command."""
    if name == "completion":
        shells = click.Choice(["bash", "zsh", "fish"])
        shell = click.Argument(["shell"], type=shells, metavar="SHELL", help="which shell")
        example = ["zv completion bash"]
        return Command(name, _print_script, {"Options": [shell]}, COMPLETION_TEXT, example)
    from zv.cli import loading

    return loading.load(name)


def _print_script(shell: str) -> None:
    found = get_completion_class(shell)
    assert found is not None
    print(found(app, {}, "zv", COMPLETION_VARIABLE).source())


def section(name: str) -> str:
    """Return the heading of a command in ``zv --help``."""
    if name == "up" or name in BY_COMMAND:
        return "Services"
    return "Setting up" if name in ("calibrate", "new", "completion") else "Tools"


def example(name: str) -> str:
    """Return an example of a command; for a group, of its first command."""
    if name in BY_COMMAND:
        return SERVICES[BY_COMMAND[name]].example.splitlines()[0]
    if name in FILE_COMMANDS:
        return FILE_COMMANDS[name].example.splitlines()[0]
    tools = [tool for words, tool in TOOLS.items() if words.split()[0] == name]
    return tools[0].example.splitlines()[0] if tools else f"zv {name}"


def _examples() -> list[str]:
    tools = [name for name in COMMANDS if section(name) == "Tools"]
    return [*map(example, ["up", "camera", *tools[:5]]), "zv COMMAND --help"]


def _print_version(context: click.Context, _option: click.Parameter, wanted: bool) -> None:
    if wanted and not context.resilient_parsing:
        from importlib.metadata import PackageNotFoundError, version
        from importlib.resources import files

        try:
            click.echo(f"zv {version('zenoh-vision')}")
        except PackageNotFoundError:
            click.echo("zv of a checkout that is not installed")
        weights = files("zv") / "edge" / "detectors" / "learned.onnx"
        more = ", except the weights of the edge detector learned (LicenseRef-BSDS500-weights)"
        click.echo(f"licence: Apache-2.0{more if weights.is_file() else ''}")
        context.exit()


VERSION = click.Option(
    ["--version"],
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="show the version and the licence, and exit",
)

app = Group(
    "zv",
    "Cameras and vision on the network without ROS.",
    COMMANDS,
    load,
    _examples(),
    section,
    [VERSION],
    longer=[words for words in TOOLS if " " in words],
)


def run() -> int:
    """Run the command of ``sys.argv``, or a completion request, and return the exit status."""
    if instruction := os.environ.get(COMPLETION_VARIABLE):
        from zv.cli.completion import complete

        status = complete(app, "zv", COMPLETION_VARIABLE, instruction)
        sys.stdout.flush()
        if "zenoh" in sys.modules:
            os._exit(status)  # a shell waits, and Zenoh may still be opening a session
        return status
    return run_command(app, "zv", sys.argv[1:])


def main() -> None:
    """Run ``zv``; an error is printed in one line and becomes the exit status."""
    exit_with_status(run)
