"""Types ``zv`` commands that end: each in a process of its own, forked from one that has it all.

A new interpreter takes longer to load a tool than most tools take for their work. Tests of what
a start loads, and of programs that run until they are stopped, start one all the same.
"""

from __future__ import annotations

import atexit
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
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from tests.processes import ROOT, START_S, environment

ZV = "services.cli.main"
"""The module whose ``main`` is called."""

_TYPISTS: dict[str, Typist] = {}


def type_zv(
    arguments: Sequence[object],
    *,
    folder: Path = ROOT,
    program: str = ZV,
    timeout_s: float = START_S,
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    """Run ``zv`` with these arguments to its end.

    Args:
        arguments: Behind ``zv``.
        folder: Where one is when typing it.
        program: A module whose ``main`` is ``zv``.
        timeout_s: It must have ended by then.
        variables: Of the environment, beside those of every program.
    """
    if program not in _TYPISTS:
        _TYPISTS[program] = Typist(program)
    return _TYPISTS[program].run([str(each) for each in arguments], folder, variables, timeout_s)


class Typist:
    """The process that the commands are forked from; ends with the tests.

    Args:
        program: The module whose ``main`` is called.
    """

    def __init__(self, program: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.typist", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env=environment(),
        )
        atexit.register(self._end)

    def run(
        self, arguments: list[str], folder: Path, variables: dict[str, str], timeout_s: float
    ) -> subprocess.CompletedProcess[str]:
        """Run one command; its output is text, what is none of UTF-8 replaced."""
        with tempfile.TemporaryDirectory() as place:
            files = [Path(place) / name for name in ("out", "err")]
            order = {
                "arguments": arguments,
                "folder": str(folder),
                "environment": environment() | variables,
                "files": [str(file) for file in files],
            }
            status = self._ask(order, timeout_s)
            out, err = (file.read_text(errors="replace") for file in files)
        return subprocess.CompletedProcess(["zv", *arguments], status, out, err)

    def _ask(self, order: dict[str, Any], timeout_s: float) -> int:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        pid = int(self._process.stdout.readline())
        late = threading.Timer(timeout_s, os.kill, (pid, signal.SIGKILL))
        late.start()
        try:
            status = int(self._process.stdout.readline())
        finally:
            late.cancel()
        assert status != -signal.SIGKILL, f"{order['arguments']}: no end within {timeout_s:g} s"
        return status

    def _end(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(5)
        self._process.stdout.close()


def serve() -> bool:
    """Fork for each order; return True in the process that is to run one, False at the end."""
    answers = os.fdopen(os.dup(1), "w")
    orders = os.fdopen(os.dup(0))
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nothing, stream)
    for line in orders:
        order = json.loads(line)
        pid = os.fork()
        if not pid:
            begin(order)
            return True
        print(pid, file=answers, flush=True)
        _, status = os.waitpid(pid, 0)
        print(os.waitstatus_to_exitcode(status), file=answers, flush=True)
    return False


def begin(order: dict[str, Any]) -> None:
    """Make this process what it would be if the command had been typed."""
    sys.argv = ["zv", *order["arguments"]]
    os.chdir(order["folder"])
    os.environ.clear()
    os.environ.update(order["environment"])
    for stream, name in zip((1, 2), order["files"], strict=True):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), stream)


def run_and_leave(main: Callable[[], None]) -> NoReturn:
    """Run the command, and end as an interpreter does, but for taking all modules apart."""
    try:
        main()
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        status = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(status)


def load_all() -> None:
    """Load whatever a tool may need."""
    import services.cli
    import services.tools

    for package in (services.cli, services.tools):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for name in ("cv2", "pydantic_settings", "rich.live", "rich.table", "typer.rich_utils"):
        importlib.import_module(name)


if __name__ == "__main__":
    main = importlib.import_module(sys.argv[1]).main
    load_all()
    gc.freeze()  # else each fork would copy all that a collection looks at
    if serve():
        run_and_leave(main)
