"""The system under test: real processes, their CPU time and memory."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from typing import Self

import psutil
import zenoh

from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import open_session

SCHEDULED = 2
"""Kind of a process' clock that counts the time of all its threads, those that ended too."""


def cpu_s(pid: int) -> float:
    """Return the CPU time of a process so far, seconds."""
    # The clock of a process, as clock_getcpuclockid names it: psutil only counts in ticks.
    return time.clock_gettime(~pid << 3 | SCHEDULED)


def free_endpoint() -> str:
    """Return a loopback endpoint that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


class System:
    """A router and the processes that are started with it; all end with the ``with`` block."""

    def __init__(self) -> None:
        self.endpoint = free_endpoint()
        self.processes: dict[str, psutil.Popen] = {}
        self._cpu_s: dict[str, float] = {}

    def __enter__(self) -> Self:
        self.start("router", "-m", "zv", "router", "--listen", self.endpoint)
        self.session().close()
        return self

    def __exit__(self, *error: object) -> None:
        for name, process in reversed(self.processes.items()):
            process.terminate()
            try:
                process.wait(3)
            except psutil.TimeoutExpired:
                print(f"{name} did not end in 3 s", file=sys.stderr)
                process.kill()
                process.wait()

    def session(self) -> zenoh.Session:
        """Open a client session, waiting for the router."""
        return open_session(Connection(connect=self.endpoint, timeout_s=60))

    def start(self, name: str, *arguments: str) -> None:
        """Start a Python process; it counts under this name."""
        self.processes[name] = psutil.Popen(
            [sys.executable, *arguments], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )

    def service(self, name: str, service: str, *flags: str) -> None:
        """Start ``zv SERVICE`` in this system."""
        self.start(name, "-m", "zv", service, "--connect", self.endpoint, *flags)

    def begin(self) -> None:
        """Start to count CPU time."""
        self._cpu_s = {name: cpu_s(process.pid) for name, process in self.processes.items()}
        self._begun_s = time.monotonic()

    def cpu_s(self) -> dict[str, float]:
        """Return the CPU seconds of each process since ``begin``.

        Raises:
            SystemExit: A process has ended, so that nothing else that was measured is true.
        """
        for name, process in self.processes.items():
            if process.poll() is not None:
                raise SystemExit(f"{name} has ended with status {process.poll()}")
        return {
            name: cpu_s(self.processes[name].pid) - begun for name, begun in self._cpu_s.items()
        }

    def memory_mb(self) -> dict[str, float]:
        """Return the resident memory of each process."""
        return {name: p.memory_info().rss / 1e6 for name, p in self.processes.items()}
