"""The entry point of ``zv``: runs the command of ``sys.argv`` and returns an exit status.

Loads neither cv2 nor zenoh nor any settings before a command is called.
"""

from __future__ import annotations

import os
import sys
import threading

import click
from click.shell_completion import get_completion_class, shell_complete

from zv.cli.command import Command, Group
from zv.cli.errors import reader_is_gone, tell, tell_end_of_thread
from zv.registry import BY_COMMAND, SERVICES
from zv.tools.registry import GROUPS, TOOLS

COMMANDS = {
    "up": "Start and supervise a whole system from one file.",
    **{command: SERVICES[name].summary for command, name in BY_COMMAND.items()},
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
    return "Setting up" if name == "completion" else "Tools"


def example(name: str) -> str:
    """Return an example of a command; for a group, of its first command."""
    if name in BY_COMMAND:
        return SERVICES[BY_COMMAND[name]].example
    tools = [tool for words, tool in TOOLS.items() if words.split()[0] == name]
    return tools[0].example.splitlines()[0] if tools else f"zv {name}"


def _examples() -> list[str]:
    tools = [name for name in COMMANDS if section(name) == "Tools"]
    return [*map(example, ["up", "camera", *tools[:5]]), "zv COMMAND --help"]


app = Group(
    "zv", "Cameras and vision on the network without ROS.", COMMANDS, load, _examples(), section
)


def run() -> int:
    """Run the command of ``sys.argv``, or a completion request, and return the exit status."""
    if instruction := os.environ.get(COMPLETION_VARIABLE):
        return shell_complete(app, {}, "zv", COMPLETION_VARIABLE, instruction)
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    try:
        with app.make_context("zv", sys.argv[1:], color=False if plain else None) as context:
            return app.invoke(context) or 0
    except click.exceptions.Exit as end:
        return end.exit_code


def main() -> None:
    """Run ``zv``; an error is printed in one line and becomes the exit status."""
    debug = "--debug" in sys.argv[1:]
    if not debug:
        threading.excepthook = tell_end_of_thread
    try:
        status = run()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        status = 0
    except (Exception, SystemExit) as error:
        if reader_is_gone(error):
            status = 0
        elif isinstance(error, SystemExit):
            raise
        else:
            status = tell(error, debug=debug)
    sys.exit(status)
