"""Types ``zv`` commands that end, each in a process of its own (see ``fork_server``)."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.support.fork_server import ZV
from tests.support.processes import ROOT, START_S, environment, fork


def type_zv(
    arguments: Sequence[object],
    *,
    folder: Path = ROOT,
    program: str = ZV,
    first: str | None = None,
    timeout_s: float = START_S,
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    """Run ``zv`` with these arguments to its end; what is no UTF-8 in its output is replaced.

    Args:
        arguments: Behind ``zv``.
        folder: Its working directory.
        program: A module whose ``main`` is ``zv``.
        first: The module that its server imports before all others; None for the program.
        timeout_s: It must have ended by then.
        variables: Of the environment, beside those of every program.
    """
    words = [str(each) for each in arguments]
    with tempfile.TemporaryDirectory() as place:
        out, err = (Path(place) / name for name in ("out", "err"))
        process = fork(
            words,
            first=first or program,
            program=program,
            folder=folder,
            environment=environment() | variables,
            out=out,
            err=err,
        )
        try:
            status = process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise AssertionError(f"{words}: no end within {timeout_s:g} s") from None
        texts = [file.read_text(errors="replace") for file in (out, err)]
    return subprocess.CompletedProcess(["zv", *words], status, *texts)


def zv(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command at a router and return its output and status."""
    return type_zv([*arguments, "--connect", endpoint])


def quick_zv(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """As ``zv``; but it waits less for reports and messages (``programs/quick_zv``)."""
    words = [*arguments, "--connect", endpoint]
    return type_zv(words, first=ZV, program="tests.support.programs.quick_zv")
