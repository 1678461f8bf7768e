"""One router for the tests of a module, and the tools in the process of the tests."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import pytest
import zenoh

from tests.support.listening import open_client
from tests.support.waiting import DEADLINE_S
from zenoh_vision.transport.connection import Connection
from zv.tools.shared.options import ToolOptions
from zv.tools.shared.output import Output
from zv.tools.topic import echo, info, measure, pub
from zv.tools.topic import list as list_
from zv.tools.topic.options import (
    BwOptions,
    DelayOptions,
    EchoOptions,
    HzOptions,
    InfoOptions,
    ListOptions,
    PubOptions,
)

RUNS: dict[type[ToolOptions], Callable[..., None]] = {
    ListOptions: list_.run,
    InfoOptions: info.run,
    EchoOptions: echo.run,
    HzOptions: measure.run_hz,
    BwOptions: measure.run_bw,
    DelayOptions: measure.run_delay,
    PubOptions: pub.run,
}


@pytest.fixture
def client(endpoint: str) -> Iterator[zenoh.Session]:
    with open_client(endpoint) as session:
        yield session


@pytest.fixture
def zv(endpoint: str, capsys: pytest.CaptureFixture[str]) -> Callable[..., list[str]]:
    """``zv(HzOptions(...))`` runs a tool in this process and returns its lines."""

    def run(
        options: ToolOptions, *, as_json: bool = False, timeout_s: float = DEADLINE_S
    ) -> list[str]:
        capsys.readouterr()
        connection = Connection(connect=endpoint, timeout_s=timeout_s)
        RUNS[type(options)](options, connection, Output(as_json=as_json))
        out, notes = capsys.readouterr()
        print(notes, end="", file=sys.stderr)  # for a test that reads them
        return out.splitlines()

    return run
