"""Types ``zv`` commands that end, each in a process of its own (see ``fork_server``)."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.support.fork_server import ROOT, ZV
from tests.support.processes import START_S, Program


def type_zv(
    arguments: Sequence[object],
    *,
    folder: Path = ROOT,
    program: str = ZV,
    timeout_s: float = START_S,
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    """Run ``zv``, or another module's ``main``, to its end."""
    words = [str(each) for each in arguments]
    with (
        tempfile.TemporaryDirectory() as place,
        Program(words, Path(place), "zv", program, folder, **variables) as zv,
    ):
        status = zv.process.wait(timeout_s)
        return subprocess.CompletedProcess(["zv", *words], status, zv.output, zv.complaints)


def zv(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command at a router and return its output and status."""
    return type_zv([*arguments, "--connect", endpoint])


def quick_zv(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """As ``zv``; but it waits less for reports and messages (``programs/quick_zv``)."""
    words = [*arguments, "--connect", endpoint]
    return type_zv(words, program="tests.support.programs.quick_zv")
