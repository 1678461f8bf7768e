"""A router with new rules opens its port again, though that may still be in use for a moment."""

from __future__ import annotations

import socket
import threading

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
