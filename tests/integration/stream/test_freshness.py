"""A slow or frozen consumer sees the newest frame, never an old one, and every loss is counted."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import ExitStack
from itertools import pairwise

import cv2
import msgpack
import numpy as np
import pytest
import zenoh

from tests.support.listening import (
    Listener,
    balance,
    newest,
    open_client,
    report_after,
    wait_for_nodes,
)
from tests.support.processes import Program
from tests.support.publishing import Paced, PlainCamera
from tests.support.waiting import in_time, wait_until
from zenoh_vision.node.node import Node
from zenoh_vision.shm.machine import why_impossible
from zenoh_vision.transport.zenoh_config import LEASE_MS

WAYS = ("jpeg",) if why_impossible() else ("jpeg", "shm")
SMALL = ("--width", 320, "--height", 240)
SECONDS = 4
"""Of these a queue would hold up a consumer of 5 Hz for 3.3 s: 25 of 30 frames a second wait."""

FROZEN_S = 4.5
"""Longer than the lease of 2 s by more than the silence that is allowed."""


READERS = 16
LISTENER = "tests.support.containers.listener"


@pytest.mark.quiet
@pytest.mark.parametrize("transport", WAYS)
def test_a_consumer_of_200_ms_at_30_hz_sees_only_fresh_frames(
    connection, client, service, transport
):
    service("camera", "--rate", 30, *SMALL)
    wait_for_nodes(client, "camera_front")
    health = {
        node: Listener(client, f"@vision/diagnostics/{node}")
        for node in ("camera_front", "slow_front")
    }
    seen: list[tuple[int, int]] = []
    ages_ms: list[float] = []
    work = threading.Event()
    with Node("slow", connection=connection) as node:
        frames = node.frames("image/compressed", want="bgr", transport=transport)
        for frame in in_time(node, frames, SECONDS):
            assert way_of(node) == transport
            ages_ms.append((time.time_ns() - frame.header.stamp_ns) / 1e6)
            seen.append((frame.header.epoch, frame.header.seq))
            work.wait(0.2)
    print(
        f"{len(ages_ms)} seen, p50 {sorted(ages_ms)[len(ages_ms) // 2]:.1f}, max {max(ages_ms):.1f}"
    )
    assert len(seen) >= 4 * SECONDS  # 1 s / 200 ms = 5, less what starting takes
    assert max(ages_ms) < 250, ages_ms
    assert sorted(ages_ms)[len(ages_ms) // 2] < 60  # at 30 Hz the newest is at most 33 ms old
    assert seen == sorted(set(seen))
    for listener in health.values():
        messages = listener.messages
        assert len(messages) >= SECONDS - 2
        assert [balance(message.body["counters"]) for message in messages] == [0] * len(messages)
    last = health["slow_front"].messages[-1].body["counters"]
    assert last["processed"] == len(seen)
    assert last["dropped.overwritten"] >= 4 * len(seen)  # five of six frames
    assert last["pending"] <= 1  # the one that waited when the consumer ended


@pytest.mark.quiet
@pytest.mark.parametrize("frozen_s", [1.5, 3.0])  # within its lease of 2 s, and longer
def test_a_tracker_that_was_frozen_goes_on_with_fresh_frames(client, quick_service, frozen_s):
    tracker = quick_service("tracker")
    wait_for_nodes(client, "tracker_front")
    centroids = Listener(client, "vision/front/centroid")
    camera = PlainCamera(client)
    with camera.at(30):
        centroids.wait_for(15)
        os.kill(tracker.process.pid, signal.SIGSTOP)
        stopped_s = time.monotonic()
        threading.Event().wait(frozen_s)  # the length of the freeze is what is tested
        os.kill(tracker.process.pid, signal.SIGCONT)
        resumed_s = time.monotonic()
        after = centroids.wait_for(30, after_s=resumed_s)
        counters = report_after(client, "tracker_front", time.time_ns()).body["counters"]
    # What left the tracker before the freeze may have waited in the router.
    sent = [message for message in after if message.header["done_ns"] / 1e9 > wall(resumed_s)]
    print(f"after {sent[0].at_s - resumed_s:.3f} s one of age {sent[0].age_s:.3f} s", counters)
    assert sent[0].at_s - resumed_s < 2
    assert sent[0].age_s < 0.5
    for message in sent:
        assert message.header["done_ns"] - message.header["stamp_ns"] < 0.5e9
    assert centroids.since(stopped_s + 0.5)[0].at_s >= resumed_s
    numbers = [message.header["seq"] for message in centroids.messages]
    assert numbers == sorted(set(numbers))
    assert balance(counters) == 0
    lost = counters.get("dropped.stale", 0) + counters.get("dropped.overwritten", 0)
    if frozen_s * 1000 < LEASE_MS:  # else it may give its link up, and what waited there is missed
        assert lost >= 1
    unseen = camera_seqs(camera, stopped_s + 0.1, resumed_s) - set(numbers)
    assert unseen >= camera_seqs(camera, stopped_s + 0.1, resumed_s - 1)
    assert lost + counters.get("missed", 0) >= len(unseen) > 0


@pytest.mark.quiet
@pytest.mark.skipif("shm" not in WAYS, reason=why_impossible() or "-")
def test_a_tracker_that_was_frozen_goes_on_with_fresh_frames_from_shared_memory(
    client, quick_service
):
    tracker = quick_service("tracker", "--transport", "shm")
    quick_service("camera", "--rate", 30, *SMALL)
    centroids = Listener(client, "vision/front/centroid")
    centroids.wait_for(15)
    os.kill(tracker.process.pid, signal.SIGSTOP)
    threading.Event().wait(3.0)  # the length of the freeze is what is tested
    os.kill(tracker.process.pid, signal.SIGCONT)
    resumed_s = time.monotonic()
    after = centroids.wait_for(30, after_s=resumed_s)
    sent = [message for message in after if message.header["done_ns"] / 1e9 > wall(resumed_s)]
    assert sent[0].at_s - resumed_s < 2
    assert [message for message in sent if message.age_s > 0.5] == []
    numbers = [message.header["seq"] for message in centroids.messages]
    assert numbers == sorted(set(numbers))
    health = newest(client, "@vision/diagnostics/tracker_front")
    assert set(health.body["routes"].values()) == {"shm"}
    assert balance(health.body["counters"]) == 0


def camera_seqs(camera: PlainCamera, since_s: float, until_s: float) -> set[int]:
    """Return the numbers of the frames that were sent between two monotonic times."""
    return {seq for seq, at_s in camera.sent_s.items() if since_s < at_s < until_s}


def way_of(node: Node) -> str | None:
    """Return how the newest frame of a node's only input came."""
    return next(iter(node.inputs)).route  # type: ignore[attr-defined]


def wall(at_s: float) -> float:
    """Return a monotonic time as seconds since 1970."""
    return time.time() - time.monotonic() + at_s


@pytest.mark.quiet
def test_a_node_that_is_frozen_holds_up_nobody_else(router, client, tmp_path):
    # Frames of 0.7 MB fill the buffers on the way to it long before its lease of 2 s is over.
    noise = np.random.default_rng(1).integers(0, 256, (720, 1280, 3), np.uint8)
    picture = cv2.imencode(".jpg", noise, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
    assert len(picture) > 600_000
    camera = PlainCamera(
        client, pictures=(picture,), congestion_control=zenoh.CongestionControl.BLOCK_FIRST
    )
    with (
        open_client(router.endpoint) as other,
        Program(
            ["examples/own_service.py", "--connect", router.endpoint], tmp_path, "own"
        ) as program,
    ):
        wait_for_nodes(client, "brightness_front")
        frames = Listener(other, "vision/front/image/compressed")
        with camera.at(20):
            Listener(client, "vision/front/brightness").wait_for(5)
            os.kill(program.process.pid, signal.SIGSTOP)
            frozen_s = time.monotonic()
            try:
                # With Zenoh's own wait of 5 s there would be silence from the lease's end to here.
                threading.Event().wait(FROZEN_S)
            finally:
                os.kill(program.process.pid, signal.SIGCONT)
        times = [message.at_s for message in frames.since(frozen_s)]
        sent = sum(at_s > frozen_s for at_s in camera.sent_s.values())
    longest_s = max(b - a for a, b in pairwise(times))
    print(f"{len(times)} of {sent} frames in {FROZEN_S} s, longest silence {longest_s:.2f} s")
    assert longest_s < 1.5
    assert len(times) > 0.65 * sent
    assert sent > 0.65 * 20 * FROZEN_S


@pytest.mark.quiet
def test_readers_of_raw_frames_that_freeze_one_after_the_other_hold_up_nobody(
    router, client, tmp_path
):
    raw, small = "vision/front/image", "vision/front/centroid"
    first = zenoh.CongestionControl.BLOCK_FIRST

    def send() -> None:
        header = msgpack.packb({"epoch": 0, "seq": 0, "stamp_ns": time.time_ns()})
        client.put(raw, bytes(640 * 480 * 3), attachment=header, congestion_control=first)
        client.put(small, b"small", congestion_control=zenoh.CongestionControl.BLOCK)

    with ExitStack() as ending, open_client(router.endpoint) as other, Paced(30, send):
        arrived = Listener(other, small)
        readers = [
            ending.enter_context(
                Program([router.endpoint, raw], tmp_path, f"reader{n}", forked=LISTENER)
            )
            for n in range(READERS)
        ]
        for reader in readers:
            wait_until(lambda reader=reader: reader.output)
        begun_s = time.monotonic()
        try:
            for reader in readers:
                os.kill(reader.process.pid, signal.SIGSTOP)
                threading.Event().wait(0.2)
            # The router closes a link some 4 s after its reader froze.
            threading.Event().wait(FROZEN_S)
        finally:
            for reader in readers:
                reader.process.kill()
        times = [begun_s, *(message.at_s for message in arrived.since(begun_s))]
        longest_s = max(b - a for a, b in pairwise([*times, time.monotonic()]))
    print(f"longest silence {longest_s:.2f} s")
    assert longest_s < 1.5


@pytest.mark.quiet
def test_a_reader_of_everything_that_freezes_holds_up_nobody(router, client, service, tmp_path):
    for name in ("camera", "tracker", "edge"):
        service(name, *(("--width", 320, "--height", 240) if name == "camera" else ()))
    wait_for_nodes(client, "camera_front", "tracker_front", "edge_front")
    names = ("image/compressed", "centroid", "edges/compressed")
    arrived = [Listener(client, f"vision/front/{name}") for name in names]
    with Program(
        [router.endpoint, "vision/front/**"], tmp_path, "reader", forked=LISTENER
    ) as reader:
        wait_until(lambda: reader.output.count("\n") > 500)
        begun_s = time.monotonic()
        os.kill(reader.process.pid, signal.SIGSTOP)
        threading.Event().wait(FROZEN_S)
        reader.process.kill()
    for each in arrived:
        times = [begun_s, *(message.at_s for message in each.since(begun_s)), time.monotonic()]
        assert max(b - a for a, b in pairwise(times)) < 0.7
