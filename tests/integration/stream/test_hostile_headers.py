"""Good pictures under random headers: the frames of the camera are soon processed again."""

from __future__ import annotations

import random
import time

import numpy as np
import pytest

from tests.integration.conftest import QUICK_ZV, a_router, some_services
from tests.support.listening import Listener, balance, newest, open_client, wait_for_nodes
from tests.support.pictures.encoded import WIDTH, jpeg
from tests.support.publishing import (
    IMAGE_KEY,
    PlainCamera,
    hostile_header,
    wait_for_subscriber,
)
from tests.support.waiting import wait_until

BURST = 400
SMALL = jpeg(np.zeros((48, 64, 3), np.uint8))
"""The stranger's picture: its size shows in the results."""
RESULTS = {"tracker_front": "vision/front/centroid", "edge_front": "vision/front/edges/compressed"}


@pytest.mark.parametrize("seed", range(5))
def test_results_are_back_after_a_burst_of_hostile_headers(tmp_path, seed):
    rng = random.Random(seed)
    with (
        a_router(tmp_path) as router,
        some_services(router.endpoint, tmp_path, QUICK_ZV) as start,
        open_client(router.endpoint) as client,
    ):
        for service in ("tracker", "edge"):
            # So that a busy machine makes no frame stale: only identity and order are tested.
            start(service, "--max-age", 30)
        wait_for_nodes(client, *RESULTS)
        wait_for_subscriber(client, IMAGE_KEY)
        results = {node: Listener(client, key) for node, key in RESULTS.items()}
        camera, stranger = PlainCamera(client), PlainCamera(client, pictures=(SMALL,))
        with camera.at(30):
            for listener in results.values():
                listener.wait_for(5)
            for _ in range(BURST):
                stranger.send(**hostile_header(rng, camera))
            over_s = time.monotonic()
            for listener in results.values():
                wait_until(lambda listener=listener: true_ones(listener, camera, over_s))
        for node in RESULTS:
            counters = newest(client, f"@vision/diagnostics/{node}").body["counters"]
            assert balance(counters) == 0
            assert counters.get("missed", 0) < 10**6
            assert counters["dropped.out_of_order"] > 0


def true_ones(listener: Listener, camera: PlainCamera, since_s: float) -> bool:
    """Tell whether 15 frames that the camera sent after a time were seen, each in order."""
    numbers = [
        seq
        for message in listener.since(since_s)
        if (message.header["epoch"], message.header["width"]) == (camera.epoch, WIDTH)
        and camera.sent_s.get(seq := message.header["seq"], 0) > since_s
    ]
    assert numbers == sorted(set(numbers))
    return len(numbers) >= 15
