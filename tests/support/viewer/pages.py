"""The pages of the documentation as their tests read them: blocks, and the commands in them."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from tests.support.fork_server import SCRIPT, ZV
from tests.support.processes import ROOT, START_S, environment
from tests.support.typist import type_zv

PROGRAMS = {"zv": [sys.executable, "-m", "zv"], "python": [sys.executable]}


class Page:
    """A page, by its place in the repository.

    Attributes:
        name: Of the file.
        text: All of it.
    """

    def __init__(self, place: str) -> None:
        self.name = Path(place).name
        self.text = (ROOT / place).read_text()

    def blocks(self, language: str) -> list[str]:
        """Return the fenced blocks of a language, in their order."""
        fenced = rf"^```{language}\n(.*?)^```$"
        return re.findall(fenced, self.text, re.MULTILINE | re.DOTALL)

    def commands(self, *starts: str) -> list[str]:
        """Return each line of the shell blocks without its comment, in order.

        Args:
            starts: Only those that begin with one of these.
        """
        found = [line for block in self.blocks("sh") for line in self.commands_in(block)]
        return [line for line in found if line.startswith(starts or "")]

    def commands_in(self, block: str) -> list[str]:
        """Return the lines of a shell block without comments."""
        found = [re.sub(r"(^|\s+)# .*", "", line) for line in block.splitlines()]
        return [line for line in found if line]


def begins(command: str, *words: str) -> bool:
    """Tell whether these are a command's first words."""
    return tuple(shlex.split(command)[: len(words)]) == words


def once_each(*commands: str) -> list[str]:
    """Return the commands without those that stand there again."""
    return list(dict.fromkeys(commands))


def run_as_written(
    command: str, folder: Path, timeout_s: float = START_S, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run a line as it stands there to its end, by the shell if it has work for one.

    Args:
        command: Begins with ``zv`` or ``python``.
        folder: Where one is when typing it.
        timeout_s: It must have ended by then.
        variables: Of the environment, beside those of every program.
    """
    program, _, rest = command.partition(" ")
    forked = ZV if program == "zv" else None if rest.startswith("-") else SCRIPT
    if forked and not set(">|<;&$`") & set(command):
        words = shlex.split(rest)
        return type_zv(words, folder=folder, program=forked, timeout_s=timeout_s, **variables)
    return subprocess.run(
        ["bash", "-c", f"exec {shlex.join(PROGRAMS[program])} {rest}"],
        capture_output=True,
        text=True,
        errors="replace",
        cwd=folder,
        env=environment() | variables,
        timeout=timeout_s,
        check=False,
    )
