"""Routers in processes of their own, and ways to them: slow ones, and ones that lead nowhere."""

from __future__ import annotations

import itertools
import os
import random
import shutil
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from pathlib import Path

from tests.support.fork_server import ZV
from tests.support.processes import STOP_S, Program, environment, missing
from tests.support.waiting import wait_until

# Under the range that the kernel takes outgoing ports from: there, a client that knocks at a
# port nobody listens on can get connected to itself.
PORTS = range(20_000, 32_000)
PARTS = 16


class Router:
    """A router that can be killed, paused and started again at the same endpoint.

    Args:
        folder: Where its output goes.
        program: Module whose ``main`` is ``zv``.

    Attributes:
        started_s: When it was started last, monotonic.
    """

    def __init__(self, folder: Path, program: str = ZV) -> None:
        self.started_s = 0.0
        self.port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self._folder = folder
        self._zv = program
        self._starts = 0
        self._harmed = False
        self._program: Program | None = None

    @property
    def pid(self) -> int:
        return self.program.process.pid

    @property
    def program(self) -> Program:
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
        self.started_s = time.monotonic()
        arguments = ["router", "--listen", self.endpoint]
        name = f"router{self._starts}"
        self._program = Program(arguments, self._folder, name, forked=self._zv)

    def start(self) -> float:
        """Start it, wait until its port answers, and return the monotonic time of that."""
        self.launch()
        wait_until(self.answers, explain=lambda: self.program.complaints)
        return time.monotonic()

    def answers(self) -> bool:
        """Tell whether the port takes connections."""
        assert self._program is None or self._program.process.poll() is None, (
            self._program.complaints
        )
        return port_answers(self.port)

    @contextmanager
    def supervised(self) -> Iterator[None]:
        """Start it again when it ends since Zenoh locked up (zenoh #2619), as ``zv up`` does."""
        done = threading.Event()

        def watch() -> None:
            while not done.wait(0.5):
                program = self._program
                if program is None or program.process.poll() is None:
                    continue
                if "Zenoh has locked up" in program.complaints:
                    self.launch()

        thread = threading.Thread(target=watch, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def kill(self) -> None:
        """End it without a goodbye, as a crash does."""
        self._harmed = True
        self.program.process.kill()
        self.program.process.wait(STOP_S)
        self._program = None

    def pause(self) -> None:
        """Freeze it: connections stay, nothing moves."""
        self._harmed = True
        os.kill(self.pid, signal.SIGSTOP)

    def resume(self) -> None:
        """Let it run again."""
        os.kill(self.pid, signal.SIGCONT)

    def close(self) -> None:
        if self._program is not None:
            if self._program.process.poll() is None:
                self.resume()
            self.kill()


def ports_of(worker: str) -> Iterator[int]:
    """Yield the ports of a pytest-xdist worker for ever; no other worker is given one of them.

    A port is free until its program listens there, and again while that program is down: taken by
    chance from all, it could be that of another test.
    """
    ours = PORTS[int(worker.removeprefix("gw") or 0) % PARTS :: PARTS]
    begin = random.randrange(len(ours))  # several runs on one machine do not meet either
    return itertools.cycle([*ours[begin:], *ours[:begin]])


_OURS = ports_of(os.environ.get("PYTEST_XDIST_WORKER", ""))


def free_port() -> int:
    """Return a port that nobody listens on, and that no other test was given lately."""
    while True:
        port = next(_OURS)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port


def free_endpoint() -> str:
    """Return an endpoint of this machine that nobody listens at."""
    return f"tcp/127.0.0.1:{free_port()}"


def port_answers(port: int, address: str = "127.0.0.1") -> bool:
    """Tell whether a port takes connections, by default one of this machine."""
    try:
        socket.create_connection((address, port), 1.0).close()
    except OSError:
        return False
    return True


@contextmanager
def zenohd(folder: Path, port: int, *words: str | Path, name: str = "zenohd") -> Iterator[None]:
    """Run the official router.

    Args:
        folder: Where its log goes.
        port: That these words make it listen on.
        words: Of its command line.
        name: Of the log.
    """
    program = shutil.which("zenohd") or missing("no zenohd; the image eclipse/zenoh has it")
    with (folder / f"{name}.log").open("w") as log:
        process = subprocess.Popen([program, *words], stdout=log, stderr=log, env=environment())
    try:
        wait_until(lambda: port_answers(port))
        yield
    finally:
        process.terminate()
        process.wait(STOP_S)


ONE_WAY_S = 0.14
"""Four ways, for the two questions of Zenoh's handshake, are more than the brisk 0.3 s."""


class Way:
    """Carries what is sent to an endpoint to a router's, and back.

    Attributes:
        delay_s: How long each way takes.
        endpoint: Where it begins.
    """

    def __init__(self, router: Router, delay_s: float) -> None:
        self.delay_s = delay_s
        self._router = router
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._connect, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join(5)
        self._listener.close()
        for end in self._ends:
            end.close()

    def _connect(self) -> None:
        while True:
            try:
                here, _ = self._listener.accept()
            except OSError:
                return
            self._ends.append(here)
            try:
                there = socket.create_connection(("127.0.0.1", self._router.port))
            except OSError:
                here.close()
                continue
            self._ends.append(there)
            for pair in ((here, there), (there, here)):
                threading.Thread(target=self._carry, args=pair, daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                time.sleep(self.delay_s)
                target.sendall(data)
        with suppress(OSError):
            target.shutdown(socket.SHUT_RDWR)


def far(router: Router, delay_s: float = 0.0) -> AbstractContextManager[Way]:
    """Return a context in which there is a way to a router."""
    return closing(Way(router, delay_s))


@contextmanager
def silent_listener(port: int = 0) -> Iterator[tuple[int, list[float]]]:
    """Take connections and never say a word, like an address whose router is just away."""
    accepted: list[float] = []
    kept = []
    with socket.create_server(("127.0.0.1", port)) as listener:

        def accept() -> None:
            while True:
                try:
                    kept.append(listener.accept())
                except OSError:
                    return
                accepted.append(time.monotonic())

        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        yield listener.getsockname()[1], accepted
        listener.shutdown(socket.SHUT_RDWR)
    thread.join(5)
    for connection, _ in kept:
        connection.close()
