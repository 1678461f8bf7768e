"""Pictures that are asked for by queries are charged to the budget of the stream."""

from __future__ import annotations

import time

from tests.support.listening import newest
from tests.support.waiting import wait_until

KEY = "vision/front/image/compressed"
BUDGET = 10_000  # bytes a second
SECONDS = 4.0


def test_a_flood_of_queries_takes_no_more_than_the_budget(client, service):
    service("camera", "--max-kbps", BUDGET * 8 // 1000, "--rate", 20)
    wait_until(lambda: list(client.get(KEY, timeout=5.0)))
    assert newest(client, "vision/front/image").payload, "raw pixels are not charged"
    sizes, refusals = [], []
    begun_s = time.monotonic()
    while time.monotonic() - begun_s < SECONDS:
        for reply in client.get(KEY, timeout=5.0):  # none, if the machine is too busy
            if reply.ok is not None:
                sizes.append(len(reply.ok.payload))
            else:
                refusals.append(reply.err.payload.to_bytes().decode())
        time.sleep(0.02)
    took_s = time.monotonic() - begun_s
    # The first is paid for later: it may begin while the one before it is not.
    assert sum(sizes[:-1]) <= BUDGET * took_s
    assert len(refusals) > len(sizes)
    words = "max_kbps = 80 is used up by earlier replies; ask again in"
    assert any(words in refusal for refusal in refusals)
