"""Starts ``zv`` in processes forked from one server that has every module loaded.

A new interpreter takes longer to load a service than most tests take, and most of the suite's CPU.
Tests of what a start loads, and of signals during a start, begin an interpreter all the same.

Each process has a keeper between itself and the server: it waits for the process and writes the
exit status to a file, as only a parent can know it. If the tests end in the middle, the server ends
too, with it the keepers, and with these their processes: what ran on would disturb the next tests.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import importlib
import json
import os
import pkgutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

ROOT = Path(__file__).parents[2]
ZV = "zv.cli.main"
"""The module whose ``main`` is ``zv``."""

POLL_S = 0.005
PR_SET_PDEATHSIG = 1


class ForkedProcess:
    """What ``subprocess.Popen`` offers, for a process that the server forked.

    Args:
        pid: Of the process.
        status: File that its keeper writes the exit status to.
    """

    def __init__(self, pid: int, status: Path) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._status = status

    def poll(self) -> int | None:
        """Return the exit status, as ``Popen`` has it; None while it runs."""
        if self.returncode is None:
            written = self._status.read_text()
            self.returncode = int(written) if written.endswith("\n") else None
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status once it has ended.

        Raises:
            subprocess.TimeoutExpired: It runs on after ``timeout`` seconds.
        """
        end_s = time.monotonic() + (float("inf") if timeout is None else timeout)
        while (status := self.poll()) is None:
            if time.monotonic() > end_s:
                raise subprocess.TimeoutExpired(["zv"], timeout or 0.0)
            time.sleep(POLL_S)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """The server, in a process of its own; ends with the tests.

    Args:
        first: Module that it imports before all others.
        environment: All of its variables.
    """

    def __init__(self, first: str, environment: Mapping[str, str]) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._started = 0
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.support.fork_server", first],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env=dict(environment),
        )
        atexit.register(self._end)

    def start(
        self,
        arguments: Sequence[str],
        *,
        program: str,
        folder: Path,
        environment: Mapping[str, str],
        out: Path,
        err: Path,
    ) -> ForkedProcess:
        """Start a process; its output goes to two files.

        Args:
            arguments: Behind ``zv``.
            program: Module whose ``main`` is called.
            folder: Its working directory.
            environment: All of its variables.
            out: File for its standard output.
            err: File for its standard error.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._started += 1
        status = Path(self._folder.name) / str(self._started)
        for file in (out, err, status):
            file.write_bytes(b"")
        order = {
            "arguments": list(arguments),
            "program": program,
            "folder": str(folder),
            "environment": dict(environment),
            "files": [str(out), str(err)],
            "status": str(status),
        }
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return ForkedProcess(int(self._process.stdout.readline()), status)

    def _end(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(5)
        self._process.stdout.close()
        self._folder.cleanup()


def serve() -> Callable[[], None] | None:
    """Fork for each order.

    Returns:
        In a process that is to run a program, its ``main``; in the server None, at the end.
    """
    answers = os.fdopen(os.dup(1), "w")
    orders = os.fdopen(os.dup(0))
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nothing, stream)
    server = os.getpid()
    for line in orders:
        order = json.loads(line)
        if os.fork():
            continue
        end_with(server)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        keeper = os.getpid()
        if pid := os.fork():
            print(pid, file=answers, flush=True)
            _, status = os.waitpid(pid, 0)
            Path(order["status"]).write_text(f"{os.waitstatus_to_exitcode(status)}\n")
            os._exit(0)
        end_with(keeper)
        return prepared(order)
    return None


def end_with(parent: int) -> None:
    """Have Linux kill this process when its parent ends, in whatever way."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended already
        os._exit(1)


def prepared(order: dict[str, Any]) -> Callable[[], None]:
    """Make this process what an order asks for, and return the program's ``main``."""
    sys.argv = ["zv", *order["arguments"]]
    os.chdir(order["folder"])
    os.environ.clear()
    os.environ.update(order["environment"])
    for stream, name in zip((1, 2), order["files"], strict=True):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
    main: Callable[[], None] = importlib.import_module(order["program"]).main
    return main


def run_and_leave(main: Callable[[], None]) -> NoReturn:
    """Run the command, and end as an interpreter does, but for taking all modules apart."""
    try:
        main()
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        status = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(BrokenPipeError):
            stream.flush()
    os._exit(status)


def load_all() -> None:
    """Load whatever a command may need."""
    import zv

    for module in pkgutil.walk_packages(zv.__path__, "zv."):
        if module.name != "zv.__main__":
            importlib.import_module(module.name)
    for name in ("av", "cv2", "rich.live", "rich.table"):
        importlib.import_module(name)


if __name__ == "__main__":
    importlib.import_module(sys.argv[1])
    load_all()
    gc.freeze()  # else each fork would copy all that a collection looks at
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # keepers are waited for by nobody
    if (main := serve()) is not None:
        run_and_leave(main)
