"""How a router with new rules opens its port again, and what one says that answers no more."""

from __future__ import annotations

import socket
import threading
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, Never

import pytest

from tests.support.routing import free_port
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.transport.zenoh_config import router_config
from zv.router import service


@pytest.fixture
def taken() -> socket.socket:
    with socket.create_server(("127.0.0.1", free_port())) as listening:
        yield listening


def test_a_port_that_is_in_use_for_a_moment_is_waited_for(taken: socket.socket):
    endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
    soon = threading.Timer(0.5, taken.close)
    soon.start()
    service._opened(router_config(endpoint), None, None, wait_s=30).close()


def test_a_port_that_stays_in_use_is_told(taken: socket.socket):
    endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
    with pytest.raises(ConfigurationError, match="the port is in use"):
        service._opened(router_config(endpoint), None, None, wait_s=0.3)


@pytest.mark.parametrize(
    ("stopping", "status", "said"), [(False, 1, [service.HUNG]), (True, 0, [])]
)
def test_a_router_that_answers_no_more_ends_and_says_so_unless_it_is_to_end_anyway(
    stopping: bool,
    status: int,
    said: list[str],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
):
    def end_at_once(status: int) -> Never:
        raise SystemExit(status)

    silent = SimpleNamespace(hangs=lambda: False, end=lambda wait_s: False)
    monkeypatch.setattr(service, "Watchdog", lambda ask: silent)
    monkeypatch.setattr(service, "_exit_at_once", end_at_once)
    health_file: Any = None
    rules: Any = SimpleNamespace(changed=lambda: True, trouble=str)
    signals: Any = SimpleNamespace(stopping=stopping)
    opened: Any = nullcontext(SimpleNamespace(zid=lambda: "ab"))
    with pytest.raises(SystemExit) as ended:
        service._route(opened, health_file, rules, signals)
    assert ended.value.code == status
    assert caplog.messages == said
