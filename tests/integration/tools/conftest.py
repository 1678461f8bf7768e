"""One router for the tests of a module, and the tools in the process of the tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
import zenoh

from common.connection import Connection
from services.tools.options import ToolOptions
from services.tools.output import Output
from services.tools.topic import echo, info, listing, measuring, pub
from services.tools.topic.options import (
    BwOptions,
    DelayOptions,
    EchoOptions,
    HzOptions,
    InfoOptions,
    ListOptions,
    PubOptions,
)
from tests.integration.conftest import a_router
from tests.integration.listening import open_client

RUNS: dict[type[ToolOptions], Callable[..., None]] = {
    ListOptions: listing.run,
    InfoOptions: info.run,
    EchoOptions: echo.run,
    HzOptions: measuring.run_hz,
    BwOptions: measuring.run_bw,
    DelayOptions: measuring.run_delay,
    PubOptions: pub.run,
}


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router."""
    with a_router(tmp_path_factory.mktemp("router")) as router:
        yield router.endpoint


@pytest.fixture
def client(endpoint: str) -> Iterator[zenoh.Session]:
    """A plain Zenoh session at the router."""
    with open_client(endpoint) as session:
        yield session


@pytest.fixture
def zv(endpoint: str, capsys: pytest.CaptureFixture[str]) -> Callable[..., list[str]]:
    """``zv(HzOptions(...))`` runs a tool in this process and returns its lines."""

    def run(options: ToolOptions, *, as_json: bool = False, timeout_s: float = 5.0) -> list[str]:
        capsys.readouterr()
        connection = Connection(connect=endpoint, timeout_s=timeout_s)
        RUNS[type(options)](options, connection, Output(as_json=as_json))
        return capsys.readouterr().out.splitlines()

    return run
