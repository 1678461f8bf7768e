"""Programs as processes of their own, for tests of what a user types: output kept, ends bounded."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

import zenoh

ROOT = Path(__file__).parent.parent
START_S = 30.0
STOP_S = 5.0
POLL_S = 0.02

T = TypeVar("T")


class Program:
    """A running program; its output goes to files in a folder, both streams apart.

    Args:
        arguments: What follows the Python that runs the tests.
        folder: Where the output files go.
        name: Of the output files.
    """

    def __init__(self, arguments: Sequence[str | Path], folder: Path, name: str) -> None:
        self.name = name
        self._out = folder / f"{name}.out"
        self._err = folder / f"{name}.err"
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.process = subprocess.Popen(
                [sys.executable, *map(str, arguments)],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                cwd=ROOT,
                env=environment(),
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
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
        """Standard output so far."""
        return self._out.read_text()

    @property
    def complaints(self) -> str:
        """Standard error so far."""
        return self._err.read_text()

    def lines(self, pattern: str, count: int = 1, timeout_s: float = START_S) -> list[re.Match]:
        """Return the first complete lines of output that match, when there are enough."""

        def found() -> list[re.Match] | None:
            complete = self.output.rpartition("\n")[0].splitlines()
            matches = [match for line in complete if (match := re.fullmatch(pattern, line))]
            if len(matches) >= count:
                return matches[:count]
            assert self.process.poll() is None, f"{self.name} ended: {self.complaints}"
            return None

        return eventually(found, timeout_s, lambda: f"{self.name}: {self.output} {self.complaints}")

    def interrupt(self) -> int:
        """Press Ctrl-C and return the exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(STOP_S)


def environment() -> dict[str, str]:
    """Return the environment for a program: ours importable, no ``ZV_`` settings of the user.

    Each viewer takes a free port, since tests run beside each other.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ZV_")}
    own = {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "ZV_VIEWER_PORT": "0"}
    return {**kept, **own}


def eventually(attempt: Callable[[], T | None], timeout_s: float, explain: Callable[[], str]) -> T:
    """Return the first result that is neither None nor empty; fail after the deadline."""
    deadline = time.monotonic() + timeout_s
    while not (result := attempt()):
        assert time.monotonic() < deadline, f"nothing within {timeout_s:g} s; {explain()}"
        time.sleep(POLL_S)
    return result


def free_endpoint() -> str:
    """Return an endpoint on a port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def router(folder: Path) -> tuple[Program, str]:
    """Start the embedded router and return it with its endpoint, once it listens."""
    endpoint = free_endpoint()
    program = service("router", folder, "--listen", endpoint)
    host, port = endpoint.removeprefix("tcp/").split(":")

    def listening() -> bool:
        assert program.process.poll() is None, program.complaints
        try:
            socket.create_connection((host, int(port)), 1.0).close()
        except ConnectionRefusedError:
            return False
        return True

    eventually(listening, START_S, lambda: program.complaints)
    return program, endpoint


def service(name: str, folder: Path, *flags: str) -> Program:
    """Start a service of ours."""
    return Program(["-m", "services", name, *flags], folder, name)


def client(endpoint: str) -> zenoh.Session:
    """Return a session of a plain Zenoh client."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    return zenoh.open(config)


def newest(session: zenoh.Session, key: str, timeout_s: float = START_S) -> zenoh.Sample:
    """Return the newest sample of a stream, as soon as someone has one."""

    def ask() -> zenoh.Sample | None:
        return next((reply.ok for reply in session.get(key, timeout=2.0) if reply.ok), None)

    return eventually(ask, timeout_s, lambda: f"nobody answers on {key}")
