"""Opening a session where nothing answers, and over a link with long round trips."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from common.connection import Connection
from common.errors import RouterUnreachable
from common.session import close_session, open_session
from tests.integration.routing import Router
from tests.integration.waiting import wait_until

ONE_WAY_S = 0.14
"""Four ways, for the two questions of Zenoh's handshake, are more than the brisk 0.3 s."""


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


@contextmanager
def far(router: Router) -> Iterator[str]:
    """Return an endpoint from which all takes ``ONE_WAY_S`` to the router, and back."""
    ends: list[socket.socket] = []

    def carry(source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                time.sleep(ONE_WAY_S)
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)

    with socket.create_server(("127.0.0.1", 0)) as listener:

        def connect() -> None:
            with suppress(OSError):
                while True:
                    here, _ = listener.accept()
                    there = socket.create_connection(("127.0.0.1", router.port))
                    ends.extend((here, there))
                    for pair in ((here, there), (there, here)):
                        threading.Thread(target=carry, args=pair, daemon=True).start()

        thread = threading.Thread(target=connect, daemon=True)
        thread.start()
        yield f"tcp/127.0.0.1:{listener.getsockname()[1]}"
        listener.shutdown(socket.SHUT_RDWR)
    thread.join(5)
    for end in ends:
        end.close()


def test_an_attempt_to_reconnect_that_is_not_answered_gives_way_to_the_next(router: Router) -> None:
    session = open_session(Connection(connect=router.endpoint, timeout_s=10))
    router.kill()
    with silent_listener(router.port) as (_, accepted):
        wait_until(lambda: len(accepted) >= 3, 8, lambda: f"attempts at {accepted}")
    close_session(session)


def test_a_link_with_long_round_trips_is_given_the_time_it_needs(router: Router) -> None:
    with far(router) as endpoint:
        session = open_session(Connection(connect=endpoint, timeout_s=20))
        assert list(session.info.routers_zid())
        close_session(session)


def test_who_takes_the_connection_and_says_nothing_is_no_router() -> None:
    with silent_listener() as (port, _), pytest.raises(RouterUnreachable, match="within 1 s"):
        open_session(Connection(connect=f"tcp/127.0.0.1:{port}", timeout_s=1))
