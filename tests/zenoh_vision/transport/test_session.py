"""A session that is being opened does not hold up the end of its program."""

from __future__ import annotations

import itertools
import math
import socket
import threading
import time

import numpy as np
import pytest

from tests.support.routing import free_port
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.errors import RouterUnreachable, ToldToStop
from zenoh_vision.host import abandoned_threads
from zenoh_vision.transport import session
from zenoh_vision.transport.connection import Connection


def test_told_to_stop_it_does_not_wait_for_an_attempt_without_an_answer(monkeypatch):
    monkeypatch.setattr(session, "SHORT", session.LONG)
    told = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as silent:
        connection = Connection(connect=f"tcp/127.0.0.1:{silent.getsockname()[1]}")

        def stopping() -> bool:
            if not told.is_set():
                silent.accept()[0].detach()  # the attempt has begun, and stays without an answer
                told.set()
            return True

        with pytest.raises(ToldToStop):
            session.open_session(connection, stopping)
        assert abandoned_threads.any_is_alive()
    wait_until(lambda: not abandoned_threads.any_is_alive())


def test_with_no_time_to_wait_it_tries_once():
    connection = Connection(f"tcp/127.0.0.1:{free_port()}", timeout_s=0)
    until_s = time.monotonic() + DEADLINE_S
    with pytest.raises(RouterUnreachable):
        session.open_session(connection, lambda: time.monotonic() > until_s)


@pytest.mark.parametrize(
    ("timeout_s", "ends", "expected"), [(None, True, ToldToStop), (0.2, False, RouterUnreachable)]
)
def test_no_attempt_begins_at_the_end_of_the_wait_for_a_router_that_refuses(
    timeout_s: float | None, ends: bool, expected: type[Exception], monkeypatch
):
    tried: list[object] = []
    told = threading.Event()
    monkeypatch.setattr(session, "try_session", lambda *words: tried.append(words))

    def refused() -> bool:  # the wait has begun
        if ends:
            told.set()
        return True

    connection = Connection(f"tcp/127.0.0.1:{free_port()}", timeout_s=timeout_s)
    with pytest.raises(expected):
        session.open_session(connection, told.is_set, refused)
    assert len(tried) == 1


def test_it_waits_while_the_router_refuses_and_tries_at_once_when_it_does_no_more(monkeypatch):
    tried: list[object] = []
    polls = itertools.count(1)
    monkeypatch.setattr(session, "REFUSED_S", math.inf)
    monkeypatch.setattr(session, "POLL_S", 0.001)
    monkeypatch.setattr(session, "try_session", lambda *words: tried.append(words))
    connection = Connection(f"tcp/127.0.0.1:{free_port()}")
    with pytest.raises(ToldToStop):
        session.open_session(connection, lambda: len(tried) == 3, lambda: bool(next(polls) % 5))
    assert next(polls) == 12  # four refusals and one without, twice, and one more refusal


def test_attempts_at_a_router_that_refuses_are_as_far_apart_as_said(monkeypatch):
    at_s: list[float] = []
    monkeypatch.setattr(session, "REFUSED_S", 0.2)
    monkeypatch.setattr(session, "try_session", lambda *_: at_s.append(time.monotonic()))
    connection = Connection(f"tcp/127.0.0.1:{free_port()}")
    with pytest.raises(ToldToStop):
        session.open_session(connection, lambda: len(at_s) == 3, lambda: True)
    assert min(np.diff(at_s)) >= 0.2


def test_a_session_that_does_not_close_in_time_ends_with_the_process(monkeypatch):
    """An interpreter that ended meanwhile crashed: 139 of an edge detector on a busy machine."""
    monkeypatch.setattr(session, "CLOSE_TIMEOUT_S", 0.01)
    may_close = threading.Event()

    class Slow:
        close = staticmethod(may_close.wait)

    session.close_session(Slow())  # type: ignore[arg-type]
    assert abandoned_threads.any_is_alive()
    may_close.set()
    wait_until(lambda: not abandoned_threads.any_is_alive())
