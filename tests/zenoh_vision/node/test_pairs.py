"""What the health of a node says of inputs that it takes in pairs."""

from __future__ import annotations

import threading

import numpy as np

from tests.support.waiting import DEADLINE_S
from zenoh_vision import Node
from zenoh_vision.messages import Track
from zenoh_vision.testing import at, publishing, running_router

TRACK = Track(id=7, state="confirmed", x=8, y=8, box=[4, 4, 8, 8], area=64)
RATE_HZ = 20


def test_the_rate_of_pairs_is_that_of_one_input_and_all_items_are_counted():
    picture = np.full((16, 16), 9, np.uint8)
    with (
        running_router() as endpoint,
        publishing(endpoint, picture, rate_hz=RATE_HZ, tracks=[TRACK]),
        Node("joiner", connection=at(endpoint)) as node,
    ):
        guard = threading.Timer(DEADLINE_S, node.stop)
        guard.start()
        pairs = 0
        for frame, tracks in node.pairs(node.frames(), node.messages("tracks")):
            assert (frame.header.epoch, frame.header.seq) == (
                tracks.header.epoch,
                tracks.header.seq,
            )
            assert tracks.tracks == (TRACK,)
            pairs += 1
            if pairs == 3 * RATE_HZ:
                said = node.health.diagnostics()
                break
        guard.cancel()
    assert 0.7 * RATE_HZ < said.rate_hz < 1.3 * RATE_HZ
    assert said.counters["processed"] >= 2 * (pairs - 1)
