"""What the embedded router keeps of messages that are too large: nothing after each of them."""

from __future__ import annotations

import zenoh

from tests.support.listening import open_client
from tests.support.processes import held_bytes, peak_bytes
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.transport.zenoh_config import MAX_MESSAGE_BYTES

MESSAGES = 10


def test_memory_does_not_grow_with_the_number_of_large_messages(router: Router):
    """With glibc's arenas for all threads, two or three of ten messages were held at once."""
    with open_client(router.endpoint) as session:
        before = peak_bytes(router.pid)
        router_id = str(next(iter(session.info.routers_zid())))
        too_large = bytes(MAX_MESSAGE_BYTES + 1_000_000)
        for _ in range(MESSAGES):
            session.put("large", too_large, congestion_control=zenoh.CongestionControl.BLOCK)
            # The router closes the connection for it, and the client comes back: on a busy machine
            # before the thread that read the message has given it back.
            wait_until(lambda: list(session.get(f"@/{router_id}/router", timeout=1.0)))
            wait_until(lambda: held_bytes(router.pid) - before < 1.2 * MAX_MESSAGE_BYTES)
    assert peak_bytes(router.pid) - before < 1.5 * MAX_MESSAGE_BYTES
