"""Programs as processes of their own, for tests of what a user types: output kept, ends bounded."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn, Self

import pytest

from tests.support.fork_server import ROOT, ForkedProcess, fork
from tests.support.waiting import wait_until

START_S = 60.0
"""Time for a program to start and do its first work. It says nothing of speed, as ``STOP_S``."""

STOP_S = 20.0
"""Time for a program to end."""

WIDTH, HEIGHT = 320, 240
CAMERA_SIZE = {"ZV_CAMERA_WIDTH": str(WIDTH), "ZV_CAMERA_HEIGHT": str(HEIGHT)}
"""Of cameras whose size does not matter: three systems of 640x480 would fill two cores. It is empty
where only ``quiet`` or ``alone`` tests run, which measure the default size, or ``devices``."""


class Program:
    """A running program; its output goes to files in a folder, both streams apart.

    Args:
        arguments: What follows the Python that runs the tests; behind ``zv`` if it is forked.
        folder: Where the output files go.
        name: Of the output files.
        forked: Module whose ``main`` runs in a process that has all modules loaded; None begins
            an interpreter.
        cwd: Its working directory.
        variables: Of the environment, beside those of every program.
    """

    def __init__(
        self,
        arguments: Sequence[str | Path],
        folder: Path,
        name: str,
        forked: str | None = None,
        cwd: Path = ROOT,
        **variables: str,
    ) -> None:
        self.name = name
        self._out = folder / f"{name}.out"
        self._err = folder / f"{name}.err"
        self.process: subprocess.Popen[bytes] | ForkedProcess
        words = [str(each) for each in arguments]
        if forked is not None:
            given = environment() | variables
            self.process = fork(forked, words, cwd, given, self._out, self._err)
            return
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.process = subprocess.Popen(
                [sys.executable, *words],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                cwd=cwd,
                env=environment() | variables,
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """End the program, by force if it must be."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait(STOP_S)

    @property
    def output(self) -> str:
        return self._out.read_text(errors="replace")

    @property
    def complaints(self) -> str:
        """Standard error so far."""
        return self._err.read_text(errors="replace")

    def lines(self, pattern: str, count: int = 1, timeout_s: float = START_S) -> list[re.Match]:
        """Return the first complete lines of output that match, when there are enough."""

        def found() -> list[re.Match] | None:
            complete = self.output.rpartition("\n")[0].splitlines()
            matches = [match for line in complete if (match := re.fullmatch(pattern, line))]
            if len(matches) >= count:
                return matches[:count]
            assert self.process.poll() is None, f"{self.name} ended: {self.complaints}"
            return None

        return wait_until(found, timeout_s, lambda: f"{self.name}: {self.output} {self.complaints}")

    def interrupt(self) -> int:
        """Press Ctrl-C and return the exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(STOP_S)


def catches(pid: int, number: int) -> bool:
    """Tell whether a process has a handler of its own for a signal, by Linux's ``/proc``."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    return bool(caught & 1 << number - 1)


def run_program(
    command: Sequence[object], *, folder: Path = ROOT, typed: str | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; ``typed`` is its standard input, ``variables`` its environment."""
    return subprocess.run(
        [str(word) for word in command],
        input=typed,
        capture_output=True,
        text=True,
        cwd=folder,
        env=environment() | variables,
        timeout=START_S,
        check=False,
    )


def peak_bytes(pid: int) -> int:
    """Return the most memory that a process has held."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    assert found
    return int(found[1]) * 1000


def environment() -> dict[str, str]:
    """Return the environment for a program: ours importable, no ``ZV_`` settings of the user.

    Each viewer takes a free port and each camera has ``CAMERA_SIZE``, since tests run beside each
    other.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ZV_")}
    own = {"PYTHONPATH": str(ROOT), "ZV_VIEWER_PORT": "0"}
    return {**kept, **own, **CAMERA_SIZE}


def need(program: str, package: str) -> str:
    """Return the path of a program that a Debian package has, which ``.ci/run`` installs."""
    return shutil.which(program) or missing(f"no {program}; Debian package {package}")


def missing(reason: str) -> NoReturn:
    """Skip the test; fail it where the variable ``CI`` is set, since CI installs every tool."""
    if os.environ.get("CI"):
        pytest.fail(f"CI must have it: {reason}")
    pytest.skip(reason)
