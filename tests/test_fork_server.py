"""The server that most programs of tests are forked from."""

from __future__ import annotations

from pathlib import Path

import psutil

from tests.support.fork_server import ZV, ForkServer
from tests.support.processes import environment
from tests.support.routing import free_endpoint
from tests.support.waiting import wait_until


def test_what_a_server_has_started_ends_when_it_is_killed(tmp_path: Path):
    server = ForkServer(ZV, environment())
    program = server.start(
        ["router", "--listen", free_endpoint()],
        program=ZV,
        folder=tmp_path,
        environment=environment(),
        out=tmp_path / "out",
        err=tmp_path / "err",
    )
    running = psutil.Process(program.pid)
    keeper = running.parent()
    assert keeper is not None
    server._process.kill()
    wait_until(lambda: not any(map(goes_on, (keeper, running))))


def goes_on(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
