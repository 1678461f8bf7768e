"""What the embedded router keeps of messages that are too large: nothing after each of them."""

from __future__ import annotations

import pytest
import zenoh

from tests.support.listening import open_client
from tests.support.processes import peak_bytes
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.transport.zenoh_config import MAX_MESSAGE_BYTES

MESSAGES = 10


# On a busy machine the client is back before the router has given back the message before.
@pytest.mark.alone
def test_memory_does_not_grow_with_the_number_of_large_messages(router: Router):
    """With glibc's arenas for all threads, two or three of ten messages were held at once."""
    with open_client(router.endpoint) as session:
        before = peak_bytes(router.pid)
        router_id = str(next(iter(session.info.routers_zid())))
        too_large = bytes(MAX_MESSAGE_BYTES + 1_000_000)
        for _ in range(MESSAGES):
            session.put("large", too_large, congestion_control=zenoh.CongestionControl.BLOCK)
            # The router closes the connection for it, and the client comes back.
            wait_until(lambda: list(session.get(f"@/{router_id}/router", timeout=1.0)))
    assert peak_bytes(router.pid) - before < 1.5 * MAX_MESSAGE_BYTES
