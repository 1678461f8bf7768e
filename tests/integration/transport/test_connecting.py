"""Opening a session where nothing answers, and over a link with long round trips."""

from __future__ import annotations

import pytest

from tests.support.routing import ONE_WAY_S, Router, far, silent_listener
from tests.support.waiting import wait_until
from zenoh_vision.errors import RouterUnreachable
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import close_session, open_session


def test_an_attempt_to_reconnect_that_is_not_answered_gives_way_to_the_next(router: Router) -> None:
    session = open_session(Connection(connect=router.endpoint, timeout_s=10))
    router.kill()
    with silent_listener(router.port) as (_, accepted):
        wait_until(lambda: len(accepted) >= 3, 8, lambda: f"attempts at {accepted}")
    close_session(session)


def test_a_link_with_long_round_trips_is_given_the_time_it_needs(router: Router) -> None:
    with far(router, ONE_WAY_S) as way:
        session = open_session(Connection(connect=way.endpoint, timeout_s=20))
        assert list(session.info.routers_zid())
        close_session(session)


def test_a_server_that_accepts_and_stays_silent_is_not_a_router() -> None:
    with silent_listener() as (port, _), pytest.raises(RouterUnreachable, match="within 1 s"):
        open_session(Connection(connect=f"tcp/127.0.0.1:{port}", timeout_s=1))
