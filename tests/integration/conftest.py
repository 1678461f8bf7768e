"""A real router and real services for each test, in processes of their own."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import zenoh

from tests.support.fork_server import ZV
from tests.support.listening import open_client
from tests.support.pictures.encoded import write_video
from tests.support.processes import Program
from tests.support.routing import Router
from zenoh_vision.transport.connection import Connection

Service = Callable[..., Program]


QUICK_ZV = "tests.support.programs.quick_zv"
LOSSLESS_ZV = "tests.support.programs.lossless_zv"
SPARE: list[Router] = []
"""Routers that nothing was done to. They keep nothing of who has left, so one serves the next."""


@contextmanager
def a_router(folder: Path) -> Iterator[Router]:
    """Yield a router that runs; one that a test killed or froze is no other test's."""
    router = SPARE.pop() if SPARE else Router(folder)
    try:
        if not router.unharmed:
            router.start()
        yield router
    finally:
        if router.unharmed:
            SPARE.append(router)
        else:
            router.close()


@pytest.fixture(scope="session", autouse=True)
def _spare_routers_end() -> Iterator[None]:
    yield
    while SPARE:
        SPARE.pop().close()


@contextmanager
def some_services(endpoint: str, folder: Path, program: str = ZV) -> Iterator[Service]:
    """Yield what starts services at an endpoint; end them by their process ids.

    Args:
        endpoint: Of a router.
        folder: Where their output goes.
        program: Module whose ``main`` is ``zv``.
    """
    programs: list[Program] = []

    def start(name: str, *flags: object) -> Program:
        arguments = [name, "--connect", endpoint, *map(str, flags)]
        programs.append(Program(arguments, folder, f"{name}{len(programs)}", forked=program))
        return programs[-1]

    try:
        yield start
    finally:
        for program in programs:
            with suppress(ProcessLookupError):
                os.kill(program.process.pid, signal.SIGCONT)  # one that is stopped cannot end
            program.process.terminate()
        for program in programs:
            program.__exit__(None, None, None)


@pytest.fixture
def router(tmp_path: Path) -> Iterator[Router]:
    """The real ``zv router`` on a free port."""
    with a_router(tmp_path) as running:
        yield running


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router for all tests of a module."""
    with a_router(tmp_path_factory.mktemp("router")) as running:
        yield running.endpoint


@pytest.fixture
def connection(router: Router) -> Connection:
    return Connection(router.endpoint, timeout_s=20)


@pytest.fixture
def client(router: Router) -> Iterator[zenoh.Session]:
    with open_client(router.endpoint) as session:
        yield session


@pytest.fixture
def service(router: Router, tmp_path: Path) -> Iterator[Service]:
    """``service("tracker", "--history", 50)`` starts one at the router, with its output kept."""
    with some_services(router.endpoint, tmp_path) as start:
        yield start


@pytest.fixture
def quick_service(router: Router, tmp_path: Path) -> Iterator[Service]:
    """As ``service``, but their counters are published ten times a second."""
    with some_services(router.endpoint, tmp_path, QUICK_ZV) as start:
        yield start


@pytest.fixture
def lossless_service(router: Router, tmp_path: Path) -> Iterator[Service]:
    """As ``service``; but no frame that was published is dropped on the way."""
    with some_services(router.endpoint, tmp_path, LOSSLESS_ZV) as start:
        yield start


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """A video file of 20 frames at 30 Hz."""
    return write_video(tmp_path / "square.avi", frames=20, rate_hz=30)
