"""What a router takes from somebody with a certificate: so large, so often, so many sessions."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest
import zenoh

from tests.support.secured import Secured, embedded, official, secured
from tests.support.waiting import wait_until
from zenoh_vision.errors import RouterUnreachable
from zenoh_vision.transport.link import Link
from zv.tools.security.router_file import (
    CHANGES_HZ,
    CONTROL_BYTES,
    MIN_SESSIONS,
    QUERY_BYTES,
    REPORTS_HZ,
)

HEALTH = "@vision/diagnostics/camera_front"
MESSAGE = "vision/front/camera_info"
SET = "@vision/set/camera_front"
BURST = [b"xx"] * 50
BEGIN, END = b"1", b""
PAUSE_S = 2 / REPORTS_HZ
"""After this long a router takes the next report."""

SESSIONS = 5
"""Of the routers here; by default there are too many to open."""


@pytest.fixture(scope="module", params=[official, embedded], ids=["zenohd", "embedded"])
def router(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Secured]:
    folder = tmp_path_factory.mktemp("limits")
    system = secured(folder)
    content = system.content("router")
    assert content["transport"]["unicast"]["max_sessions"] == MIN_SESSIONS
    content["transport"]["unicast"]["max_sessions"] = SESSIONS
    system.rewrite("router", content)
    with request.param(system, folder):
        yield system


@dataclass
class Passed:
    """What of several payloads has passed a router, by size, and in how many seconds at most."""

    sizes: list[int]
    took_s: float


def passed(router: Secured, key: str, *payloads: bytes) -> Passed:
    """Send payloads of at least two bytes: by queries on a key that sets, else as samples."""
    taken: list[int] = []
    sender, taker = ("operator", "camera_front") if key == SET else ("camera_front", "guest")

    def take(message: zenoh.Sample | zenoh.Query) -> None:
        taken.append(len(message.payload or b""))
        if isinstance(message, zenoh.Query):
            message.drop()

    with router.client(sender) as sends, router.client(taker) as takes:
        declare = takes.declare_queryable if key == SET else takes.declare_subscriber
        kept = declare(key, take)

        def send(payload: bytes) -> None:
            if key == SET:
                sends.get(key, lambda _: None, payload=payload, timeout=5.0)
            else:
                sends.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

        def arrives(mark: bytes) -> bool:
            send(mark)
            return len(mark) in taken

        wait_until(lambda: arrives(BEGIN), 20, poll_s=PAUSE_S)
        time.sleep(PAUSE_S)
        began_s = time.monotonic()
        for payload in payloads:
            send(payload)
        time.sleep(PAUSE_S)
        wait_until(lambda: arrives(END), 20, poll_s=PAUSE_S)
        took_s = time.monotonic() - began_s
        del kept
    return Passed([size for size in taken if size > len(BEGIN)], took_s)


@pytest.mark.parametrize(
    ("key", "limit"), [(HEALTH, CONTROL_BYTES), (MESSAGE, CONTROL_BYTES), (SET, QUERY_BYTES)]
)
def test_what_is_larger_than_its_limit_is_dropped(router: Secured, key: str, limit: int):
    assert passed(router, key, bytes(limit + 1)).sizes == []
    # On a busy machine its rate may be the reason once.
    wait_until(lambda: passed(router, key, bytes(limit)).sizes == [limit], 30)


@pytest.mark.parametrize(("key", "rate_hz"), [(HEALTH, REPORTS_HZ), (SET, CHANGES_HZ)])
def test_what_comes_too_often_is_dropped(router: Secured, key: str, rate_hz: float):
    found = passed(router, key, *BURST)
    assert 1 <= len(found.sizes) <= 2 + found.took_s * rate_hz


def test_streams_have_no_limit_of_their_rate(router: Secured):
    assert len(passed(router, MESSAGE, *BURST).sizes) == len(BURST)


def test_who_opens_too_many_sessions_gets_no_more_and_the_others_stay(router: Secured):
    with ExitStack() as opened:
        first = [opened.enter_context(router.client("guest")) for _ in range(SESSIONS)]
        with pytest.raises(RouterUnreachable):
            Link(router.connection("operator", timeout_s=2.0)).close()
        assert all(list(session.info.routers_zid()) for session in first)
    wait_until(lambda: connects(router), 20)


def connects(router: Secured) -> bool:
    try:
        Link(router.connection("operator", timeout_s=2.0)).close()
    except RouterUnreachable:
        return False
    return True
