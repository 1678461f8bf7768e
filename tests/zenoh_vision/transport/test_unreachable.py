"""Why no router answers is told by what a greeting of Zenoh's protocol gets."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from tests.support.routing import free_port
from zenoh_vision.errors import RouterUnreachable
from zenoh_vision.testing import running_router
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.endpoints import TcpEndpoint, tcp_endpoint
from zenoh_vision.transport.session import open_session
from zenoh_vision.transport.unreachable import examined, greeting, is_acknowledgement, is_refusal


@contextmanager
def answering(answer: Callable[[socket.socket], object]) -> Iterator[TcpEndpoint]:
    """Yield an endpoint where something else than a router answers each connection."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    link, _ = server.accept()
                except OSError:
                    return
                with link:
                    answer(link)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield TcpEndpoint("tcp", "127.0.0.1", server.getsockname()[1])
        server.shutdown(socket.SHUT_RDWR)
    thread.join(5)


def answer_of_a_router(version: int) -> bytes:
    with running_router() as endpoint:
        found = tcp_endpoint(endpoint)
        assert found is not None
        with socket.create_connection((found.address, found.port), 5) as link:
            link.sendall(greeting(version))
            return link.recv(100)


def test_a_real_router_acknowledges_our_version_and_refuses_others():
    assert is_acknowledgement(answer_of_a_router(9))
    assert not is_refusal(answer_of_a_router(9)[:-1])
    other = answer_of_a_router(8)
    assert is_refusal(other)
    assert not is_acknowledgement(other)


def test_a_router_of_another_version_is_called_that():
    refusal = answer_of_a_router(8)
    with answering(lambda link: (link.recv(64), link.sendall(refusal))) as endpoint:
        assert "another version of Zenoh's protocol" in examined(endpoint, 5)


def test_another_program_is_called_that():
    with answering(lambda link: (link.recv(64), link.sendall(b"HTTP/1.1 400 Bad\r\n"))) as endpoint:
        assert "no Zenoh router" in examined(endpoint, 5)
    with answering(lambda link: link.recv(64)) as endpoint:
        assert "no Zenoh router" in examined(endpoint, 5)


def test_a_router_that_answers_late_has_a_congested_link():
    acknowledgement = answer_of_a_router(9)

    def late(link: socket.socket) -> None:
        link.recv(64)
        time.sleep(0.7)  # longer than a handshake may take
        link.sendall(acknowledgement)

    with answering(late) as endpoint:
        found = examined(endpoint, 5)
    assert "it answers after 0." in found
    assert "the link is congested or slow" in found
    assert "start" not in found


def test_what_accepts_and_never_answers_may_hang_or_be_behind_a_congested_link():
    silent = threading.Event()
    with answering(lambda _: silent.wait(5)) as endpoint:
        found = examined(endpoint, 0.3)
        silent.set()
    assert "does not answer within" in found
    assert "congested" in found


def test_a_router_that_accepts_and_makes_no_tls_is_not_told_to_be_started():
    silent = threading.Event()
    with (
        answering(lambda _: silent.wait(5)) as endpoint,
        pytest.raises(RouterUnreachable, match="its port is open, but no ") as caught,
    ):
        open_session(Connection(f"tls/127.0.0.1:{endpoint.port}", timeout_s=0.5))
    silent.set()
    assert "start" not in str(caught.value)


def test_a_tool_says_it():
    for endpoint, said in (
        (f"tcp/127.0.0.1:{free_port()}", r"within 0.5 s; start one with `zv router`"),
        (f"tls/127.0.0.1:{free_port()}", r"start it with `zv router --credentials DIR/router`"),
        ("tcp/no-such-router.invalid:7447", r": the name no-such-router.invalid is not known here"),
    ):
        with pytest.raises(RouterUnreachable, match=said):
            open_session(Connection(endpoint, timeout_s=0.5))
