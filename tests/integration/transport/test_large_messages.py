"""A message over the largest raw frame is never held in memory, and holds nobody up."""

from __future__ import annotations

from contextlib import ExitStack

import zenoh

from tests.support.processes import peak_bytes
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import close_session, open_session

MB = 1_000_000
TOO_LARGE_BYTES = 400 * MB
MOST_BYTES = 300 * MB  # what is allowed, 134 MB, may be there twice while it grows


def test_a_message_over_the_limit_takes_no_memory_and_its_sender_comes_back(router: Router):
    arrived: list[tuple[str, int]] = []

    def take(sample: zenoh.Sample) -> None:
        arrived.append((str(sample.key_expr), len(sample.payload)))

    with ExitStack() as closing:
        sessions = []
        for _ in range(3):
            session = open_session(Connection(connect=router.endpoint, timeout_s=20))
            closing.callback(close_session, session)
            sessions.append(session)
        receiver, sender, other = sessions
        receiver.declare_subscriber("vision/**", zenoh.handlers.Callback(take, indirect=False))

        def arrives(session: zenoh.Session, key: str) -> bool:
            session.put(key, b"small", congestion_control=zenoh.CongestionControl.BLOCK)
            return (key, 5) in arrived

        for name, session in (("sender", sender), ("other", other)):
            wait_until(lambda s=session, n=name: arrives(s, f"vision/before/{n}"), 20)
        before_bytes = peak_bytes(router.pid)
        block = zenoh.CongestionControl.BLOCK
        sender.put("vision/large", bytes(TOO_LARGE_BYTES), congestion_control=block)
        for name, session in (("other", other), ("sender", sender)):
            wait_until(lambda s=session, n=name: arrives(s, f"vision/after/{n}"), 20)
        assert peak_bytes(router.pid) - before_bytes < MOST_BYTES
    assert {size for _, size in arrived} == {5}
