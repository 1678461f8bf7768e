"""The real ``zv router`` in a process of its own, on one port for as long as a test lasts."""

from __future__ import annotations

import os
import random
import signal
import socket
import time
from pathlib import Path

from tests.integration.waiting import wait_until
from tests.processes import Program

# Under the range that the kernel takes outgoing ports from: there, a client that knocks at a
# port nobody listens on can get connected to itself.
PORTS = range(20_000, 32_000)


class Router:
    """A router that can be killed, paused and started again at the same endpoint.

    Args:
        folder: Where its output goes.
    """

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self._folder = folder
        self._starts = 0
        self._harmed = False
        self._program: Program | None = None

    @property
    def pid(self) -> int:
        """Of the running router."""
        return self.program.process.pid

    @property
    def program(self) -> Program:
        """The running router."""
        assert self._program is not None, "the router does not run"
        return self._program

    @property
    def unharmed(self) -> bool:
        """Whether it runs, and was neither killed nor paused since its first start."""
        running = self._program is not None and self._program.process.poll() is None
        return running and not self._harmed

    def launch(self) -> None:
        """Start it, and do not wait."""
        self._starts += 1
        arguments = ["-m", "services", "router", "--listen", self.endpoint]
        self._program = Program(arguments, self._folder, f"router{self._starts}")

    def start(self) -> float:
        """Start it, wait until its port answers, and return the monotonic time of that."""
        self.launch()
        wait_until(self.answers, 20, lambda: self.program.complaints)
        return time.monotonic()

    def answers(self) -> bool:
        """Tell whether the port takes connections."""
        assert self._program is None or self._program.process.poll() is None, (
            self._program.complaints
        )
        return port_answers(self.port)

    def kill(self) -> None:
        """End it without a goodbye, as a crash does."""
        self._harmed = True
        self.program.process.kill()
        self.program.process.wait(5)
        self._program = None

    def pause(self) -> None:
        """Freeze it: connections stay, nothing moves."""
        self._harmed = True
        os.kill(self.pid, signal.SIGSTOP)

    def resume(self) -> None:
        """Let it run again."""
        os.kill(self.pid, signal.SIGCONT)

    def close(self) -> None:
        """End it if it runs."""
        if self._program is not None:
            if self._program.process.poll() is None:
                self.resume()
            self.kill()


def free_port() -> int:
    """Return a port that nobody listens on."""
    while True:
        port = random.choice(PORTS)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port


def port_answers(port: int) -> bool:
    """Tell whether a port of this machine takes connections."""
    try:
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    except OSError:
        return False
    return True
