"""``zv completion``: what a shell needs to complete commands and options of ``zv``."""

from __future__ import annotations

import inspect
from typing import Annotated, Any, Literal

import typer

from services.cli.options import command
from services.cli.shells import VARIABLE

WORDS = """Print the completion script of a shell.

For bash: zv completion bash > ~/.local/share/bash-completion/completions/zv

For zsh, in ~/.zshrc behind compinit: eval "$(zv completion zsh)"

For fish: zv completion fish > ~/.config/fish/completions/zv.fish

Example: zv completion bash"""


def load(name: str) -> Any:
    """Return the command."""
    shell = inspect.Parameter(
        "shell",
        inspect.Parameter.KEYWORD_ONLY,
        annotation=Annotated[
            Literal["bash", "zsh", "fish"], typer.Argument(help="which shell", metavar="SHELL")
        ],
    )
    return command(name, print_script, [shell], WORDS)


def print_script(*, shell: str) -> None:
    """Print the script."""
    from typer.completion import get_completion_script  # type: ignore[attr-defined]

    print(get_completion_script(prog_name="zv", complete_var=VARIABLE, shell=shell))
