"""The system under test: real processes, their CPU time and memory."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from typing import Self

import psutil
import zenoh

from zenoh_vision.messages import Centroid, Diagnostics
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import direct, open_session

CREDENTIALS = "ZV_CREDENTIALS"

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
        return open_session(self.connection())

    def connection(self) -> Connection:
        """Return how this process connects."""
        return Connection(connect=self.endpoint, timeout_s=60)

    def environment(self, name: str) -> Mapping[str, str]:
        """Return the environment of a process."""
        del name  # all have the same
        return os.environ

    def start(self, name: str, *arguments: str) -> None:
        """Start a Python process; it counts under this name."""
        self.processes[name] = psutil.Popen(
            [sys.executable, *arguments],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env=self.environment(name),
        )

    def service(self, name: str, service: str, *flags: str) -> None:
        """Start ``zv SERVICE`` in this system."""
        self.start(name, "-m", "zv", service, "--connect", self.endpoint, *flags)

    def camera(self, width: int, height: int, rate_hz: float, name: str = "front") -> None:
        """Start the camera service alone, fed from memory; it counts as ``camera`` of its name."""
        process = "camera" if name == "front" else f"camera_{name}"
        numbers = f"{width}", f"{height}", f"{rate_hz}"
        self.start(process, "-m", "benchmarks.camera", *numbers, self.endpoint, name)

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


class Watch:
    """What a client sees of centroids and health while it is open.

    Args:
        system: That it watches.
        centroids: Key expression.

    Attributes:
        ages_ms: Of each centroid on arrival.
        counts: Number of centroids by camera.
        health: The newest report of each node.
    """

    def __init__(self, system: System, centroids: str = "vision/*/centroid") -> None:
        self.session = system.session()
        self.ages_ms: list[float] = []
        self.counts: Counter[str] = Counter()
        self.health: dict[str, Diagnostics] = {}
        for key, receive in ((centroids, self._centroid), ("@vision/diagnostics/*", self._report)):
            self.session.declare_subscriber(key, direct(receive))

    def _centroid(self, sample: zenoh.Sample) -> None:
        header = Centroid.from_bytes(sample.payload.to_bytes()).header
        self.ages_ms.append((time.time_ns() - header.stamp_ns) / 1e6)
        self.counts[header.camera] += 1

    def _report(self, sample: zenoh.Sample) -> None:
        health = Diagnostics.from_bytes(sample.payload.to_bytes())
        self.health[health.node] = health
