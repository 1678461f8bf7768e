"""Messages made to keep the viewer's event loop busy: each costs it some milliseconds."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.headers import header
from tests.support.node_states import description
from tests.support.viewer.picture_streams import Registry
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet_monitor import _event
from zenoh_vision.messages import NodeDescription
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.stream.sample import Sample
from zenoh_vision.transport.query import Reply
from zv.viewer.discovery.monitor import _of_their_nodes
from zv.viewer.discovery.system_state import SystemState
from zv.viewer.streams.message_stream import MessageFeed, MessageStream

MOST_MS = 50
"""CPU time for one message. It is less than 10; some took 300 and more."""

TRACKS = "vision/front/tracks"
BODIES = {
    "200 kB in an unknown field": {"tracks": [], "more": list(range(70_000))},
    "64 kB of wrong tracks": {"tracks": [{}] * 9_000 + [None] * 50_000},
    "64 kB of maps in an unknown field": {"tracks": [], "more": [{}] * 60_000},
}
REPORT = {
    "node": "camera_front", "stamp_ns": 9, "level": 0, "message": "ok", "uptime_s": 1.0,
    "counters": {}, "rate_hz": 1.0, "latency_ms": {"p50": None, "p99": None},
}  # fmt: skip


def cost_ms(work: Callable[[], object], times: int = 5) -> float:
    """Return the CPU time of this thread that work takes, the mean of several times."""
    begun_s = time.thread_time()
    for _ in range(times):
        work()
    return 1000 * (time.thread_time() - begun_s) / times


@pytest.mark.parametrize("name", BODIES)
async def test_tracks_that_are_costly_to_check_are_dropped_and_counted_or_told_by_their_size(
    name: str,
):
    registry = Registry()
    stream = MessageStream(registry.context, TRACKS, registry.closed.append)
    intake = stream._new_intake(Consumer(registry.counters, lambda _: None))
    feed: Any = MessageFeed(stream, SimpleNamespace(set=lambda: None))  # type: ignore[arg-type]
    fields = {"header": header(1).to_map(), **BODIES[name]}
    hostile = Sample(TRACKS, msgpack.packb(fields))

    def receive() -> None:
        intake.receive(hostile)
        stream._receive(intake)

    assert cost_ms(receive) < MOST_MS
    told = [text for text in feed.take(9) if '"op":"large"' in text]
    assert len(told) + registry.counters.snapshot().get("dropped.bad_message", 0) == 5
    registry.pool.shutdown()


@pytest.mark.parametrize("counters", [25_000, 2_500])
def test_reports_with_many_wrong_counters_are_refused_soon(counters: int):
    wrong = {f"c{number}": -1 for number in range(counters)}
    sample: Any = SimpleNamespace(
        kind=zenoh.SampleKind.PUT,
        key_expr="@vision/diagnostics/camera_front",
        payload=zenoh.ZBytes(msgpack.packb({**REPORT, "counters": wrong})),
    )

    def receive() -> None:
        with pytest.raises(PayloadError):
            _event("diagnostics", sample)

    assert cost_ms(receive) < MOST_MS


@pytest.mark.parametrize(
    "publishes",
    [[f"vision/front/x{number}" for number in range(25_000)], [1] * 100_000],
    ids=["many", "wrong"],
)
def test_descriptions_of_many_keys_are_read_soon(publishes: list[Any]):
    fields = {**description(node="camera_front").to_map(), "publishes": publishes}
    system = SystemState("vision", lambda text, replaces: None)
    system.take("camera_front", True)
    payload = zenoh.ZBytes(msgpack.packb(fields))
    sample: Any = SimpleNamespace(key_expr="@vision/node/camera_front", payload=payload)

    def receive() -> None:
        for found in _of_their_nodes([Reply(sample, None, "", 0, 0)], NodeDescription):
            system.describe(found)
        system.flush()

    assert cost_ms(receive) < MOST_MS
