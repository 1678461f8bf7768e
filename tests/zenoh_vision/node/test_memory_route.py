"""The route through shared memory, without a router."""

from __future__ import annotations

from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from tests.support.waiting import wait_until
from zenoh_vision.host.clock import SYSTEM_CLOCK
from zenoh_vision.keys import shared_memory_key
from zenoh_vision.node import memory_route
from zenoh_vision.node.memory_route import MemoryRoute
from zenoh_vision.shm.machine import channel_name, machine_identity

pytest.importorskip("iceoryx2")

from zenoh_vision.shm.writer import FrameWriter


def test_it_ends_when_it_is_stopped_although_no_frame_comes(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(memory_route, "WAIT_S", 60.0)
    monkeypatch.setattr(memory_route, "JOIN_S", 0.01)
    link: Any = SimpleNamespace(declare=lambda _: SimpleNamespace(undeclare=lambda: None))
    intake: Any = SimpleNamespace(key="vision/front/image/compressed")
    route = MemoryRoute(link, "vision", "front", intake, SYSTEM_CLOCK)
    offer = shared_memory_key("vision", "front", machine_identity(), "stopped")
    with closing(FrameWriter(channel_name(offer))):
        route.start()
        thread = route._thread
        assert thread is not None
        token: Any = SimpleNamespace(key_expr=offer, kind=zenoh.SampleKind.PUT)
        route._on_token(token)
        wait_until(lambda: route.available)

        def ended() -> bool:
            route.stop()  # again, if it was only about to wait
            return not thread.is_alive()

        wait_until(ended)
