"""Counters balance in every health message, whatever is thrown at the nodes."""

from __future__ import annotations

import os
import random
import time
from itertools import pairwise

import msgpack

from tests.support.listening import Listener, balance, wait_for_nodes
from tests.support.pictures.encoded import PICTURES, damaged
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until

NODES = ("camera_front", "tracker_front", "edge_front")
REPORTS = 20
PROCESSED = 80
REASONS = (
    *("empty", "not_an_image", "no_header", "bad_header", "wrong_camera", "bad_stamp"),
    *("out_of_order", "corrupt"),
)


def test_counters_balance_in_every_health_message_beside_a_rogue_publisher(client, quick_service):
    quick_service("camera", "--rate", 40, "--width", 320, "--height", 240)
    quick_service("tracker", "--transport", "jpeg")  # nobody else can write to shared memory
    quick_service("edge", "--transport", "jpeg")
    wait_for_nodes(client, *NODES)
    health = {node: Listener(client, f"@vision/diagnostics/{node}") for node in NODES}
    listeners = [Listener(client, "vision/front/tracked/compressed")]
    rogue = Rogue(PlainCamera(client))
    with rogue.camera.at(150, rogue.send):
        for listener in health.values():
            listener.wait_for(REPORTS)
        wait_until(lambda: all_happened(health["tracker_front"], listeners[0]), 60)
    for node, listener in health.items():
        for message in listener.messages:
            counters = message.body["counters"]
            assert balance(counters) == 0, (node, counters)
            assert all(count >= 0 for count in counters.values())
            # A slot of two lanes, one in work, and one that arrives: it is counted before the one
            # that it replaces, which ten reports a second sometimes show.
            assert counters["pending"] <= 4, (node, counters)
        for earlier, later in pairwise(listener.messages):
            for name, count in earlier.body["counters"].items():
                assert name == "pending" or later.body["counters"][name] >= count


def all_happened(health: Listener, tracked: Listener) -> bool:
    """Tell whether many frames were processed, and some dropped for every reason."""
    counters = health.messages[-1].body["counters"]
    dropped = all(counters.get(f"dropped.{reason}") for reason in REASONS)
    return dropped and min(counters["processed"], len(tracked.messages)) > PROCESSED


class Rogue:
    """Sends whatever breaks things, a different one each time."""

    def __init__(self, camera: PlainCamera) -> None:
        self.camera = camera
        broken, half = damaged(PICTURES[2]), PICTURES[3][: len(PICTURES[3]) // 2]
        self._random = random.Random(1)
        self._sorts = (
            lambda: camera.put(b"", None),
            lambda: camera.put(os.urandom(300), None),
            lambda: camera.put(PICTURES[0], None),
            lambda: camera.put(PICTURES[0], os.urandom(30)),
            lambda: self._put(PICTURES[1], camera="rear"),
            lambda: self._put(PICTURES[1], stamp_ns=-1),
            lambda: self._put(PICTURES[1], epoch=1, seq=self._random.randrange(10**6)),
            lambda: self._put(broken, epoch=time.time_ns()),
            lambda: self._put(broken, epoch=time.time_ns() + 10**9),
            lambda: self._put(half, epoch=time.time_ns()),
        )

    def send(self) -> None:
        self._random.choice(self._sorts)()

    def _put(self, picture: bytes, **changes: object) -> None:
        self.camera.put(picture, msgpack.packb(self.camera.header(PICTURES[0], **changes)))
