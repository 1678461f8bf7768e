"""Starts ``zv`` in processes forked from multiprocessing's server, which has every module loaded.

A new interpreter takes longer to load a service than most tests take, and half of the suite's CPU.
Tests of what a start loads, and of signals during a start, begin an interpreter all the same.

If the tests end in the middle, the server ends too, and with it its processes: what ran on would
disturb the next tests.
"""

from __future__ import annotations

import atexit
import ctypes
import importlib
import multiprocessing
import multiprocessing.forkserver
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.context import ForkServerProcess
from pathlib import Path

ROOT = Path(__file__).parents[2]
ZV = "zv.cli.main"
"""The module whose ``main`` is ``zv``."""

SCRIPT = "tests.support.programs.script"
"""The module whose ``main`` is the program that the first argument names."""

# No test looks at formats, for which jsonschema would compile a grammar for a second in each
# process, where `make sbom` has installed it.
sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]

PR_SET_PDEATHSIG = 1
SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload(["tests.support.programs.all_modules"])


class ForkedProcess:
    """A process that the server forked, with what ``subprocess.Popen`` offers."""

    def __init__(self, process: ForkServerProcess) -> None:
        assert process.pid is not None
        self.pid = process.pid
        self._process = process

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if (status := self.poll()) is None:
            raise subprocess.TimeoutExpired(["zv"], timeout or 0.0)
        return status

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def fork(
    program: str,
    arguments: Sequence[str],
    folder: Path,
    environment: Mapping[str, str],
    out: Path,
    err: Path,
) -> ForkedProcess:
    """Call a module's ``main`` in a process of its own, whose output goes to two files."""
    for file in (out, err):
        file.write_bytes(b"")
    order = (program, list(arguments), folder, dict(environment), out, err)
    process = SERVER.Process(target=_run, args=order, daemon=True)
    process.start()
    return ForkedProcess(process)


def _run(
    program: str,
    arguments: list[str],
    folder: Path,
    environment: dict[str, str],
    out: Path,
    err: Path,
) -> None:
    """Run a program in this process, and end as an interpreter does, but for clearing modules."""
    # The server ends when nobody has this any more, and this process when the server ends.
    os.close(multiprocessing.forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    sys.argv = ["zv", *arguments]
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    for stream, file in enumerate((Path(os.devnull), out, err)):
        os.dup2(os.open(file, os.O_RDWR), stream)
    try:
        importlib.import_module(program).main()
    finally:
        atexit._run_exitfuncs()
