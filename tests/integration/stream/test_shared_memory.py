"""Frames between processes of one machine go through shared memory, by themselves."""

from __future__ import annotations

import fcntl
import os
import signal
import threading
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import zenoh

from tests.support.listening import balance, newest, wait_for_nodes
from tests.support.publishing import Paced, PlainCamera
from tests.support.waiting import in_time, wait_until
from zenoh_vision import Frame, Level, Node, ServiceSettings, queue
from zenoh_vision.config.consumer_options import FrameTransport
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.keys import shared_memory_key
from zenoh_vision.shm import reader
from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.shm.machine import (
    MEMORY,
    SharedMemoryError,
    channel_name,
    machine_identity,
    why_impossible,
)
from zenoh_vision.shm.writer import FrameWriter

pytestmark = pytest.mark.skipif(bool(why_impossible()), reason=why_impossible() or "-")

COMPRESSED_KEY, RAW_KEY = "vision/front/image/compressed", "vision/front/image"
BOTH = ["image/compressed", "image"]
SMALL = ("--width", 320, "--height", 240)


class TakerSettings(ServiceSettings):
    env_prefix: ClassVar[str] = "ZV_TAKER_"

    transport: FrameTransport = "auto"


@pytest.fixture
def taker(connection) -> Iterator[Node]:
    with Node("taker", connection=connection, parameters=TakerSettings()) as node:
        yield node


def subscribed(client: zenoh.Session, key: str) -> bool:
    with client.declare_publisher(key) as publisher:
        return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]


def change(node: Node, transport: str) -> None:
    assert node.parameters is not None
    node.parameters.change({"transport": transport})


def way_of(node: Node) -> str | None:
    return next(iter(node.inputs)).route  # type: ignore[attr-defined]


def identities(frames: Iterator[Frame], count: int) -> list[tuple[int, int]]:
    headers = [next(frames).header for _ in range(count)]
    return [(header.epoch, header.seq) for header in headers]


def test_frames_come_through_shared_memory_and_nobody_asks_for_jpeg(client, service, taker):
    camera = service("camera", *SMALL)
    frames = in_time(taker, iter(taker.frames(transport="auto")))
    next(frame for frame in frames if way_of(taker) == "shm")
    next(frame for frame in frames if not subscribed(client, COMPRESSED_KEY))
    seen = identities(frames, 30)
    assert seen == sorted(set(seen))
    assert not subscribed(client, RAW_KEY)
    counters = newest(client, "@vision/diagnostics/camera_front").body["counters"]
    assert balance(counters) == 0
    assert counters["published"] > 0, camera.output


def test_no_frame_comes_twice_or_out_of_order_while_the_way_changes(client, service, taker):
    service("camera", *SMALL, "--rate", 60)
    frames = in_time(taker, iter(taker.frames(transport="auto")), 60)
    seen, ways = [], []
    for wanted, transport in [("shm", "auto"), ("jpeg", "jpeg"), ("raw", "raw")] * 3:
        change(taker, transport)
        for frame in frames:
            seen.append((frame.header.epoch, frame.header.seq))
            if way_of(taker) == wanted:
                break
        seen += identities(frames, 10)
        ways.append(way_of(taker))
    assert ways == ["shm", "jpeg", "raw"] * 3
    assert seen == sorted(set(seen))
    counters = taker.counters.snapshot()
    assert balance(counters) == 0
    assert set(counters) <= {
        *("received", "processed", "pending", "missed"),
        *("dropped.duplicate", "dropped.overwritten", "dropped.stale"),  # stale: a busy machine
    }


def test_a_camera_that_is_killed_and_started_again_is_seen_again(client, service, taker):
    camera = service("camera", *SMALL)
    frames = in_time(taker, iter(taker.frames(transport="auto")), 60)
    for _ in range(3):
        next(frame for frame in frames if way_of(taker) == "shm")
        epoch = identities(frames, 5)[-1][0]
        os.kill(camera.process.pid, signal.SIGKILL)
        camera = service("camera", *SMALL)
        next(frame for frame in frames if frame.header.epoch > epoch)
    next(frame for frame in frames if way_of(taker) == "shm")
    wait_until(nothing_is_left_over)


def nothing_is_left_over() -> bool:
    """Let another offer begin and end, then look for what dead ones left; other tests kill too."""
    FrameWriter(f"next{uuid.uuid4().hex[:8]}").close()
    return not any(map(is_left_over, bells()))


def bells() -> list[Path]:
    return list(MEMORY.glob(f"zenoh_vision_{os.getuid()}/*.bell"))


def is_left_over(bell: Path) -> bool:
    """Tell whether the process that made a doorbell is dead: the kernel released its lock."""
    with suppress(FileNotFoundError), bell.open("r+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return bell.exists()
    return False


def test_a_camera_that_stalls_is_missed_and_seen_again(client, service, taker):
    camera = service("camera", *SMALL)
    frames = in_time(taker, iter(taker.frames(transport="auto")), 60)
    next(frame for frame in frames if way_of(taker) == "shm")
    os.kill(camera.process.pid, signal.SIGSTOP)
    said: list[str] = []

    def watch() -> None:
        wait_until(lambda: taker.health.diagnostics().level == Level.STALE)
        said.append(taker.health.diagnostics().message)
        os.kill(camera.process.pid, signal.SIGCONT)

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    next(frame for frame in frames if said)
    watching.join()
    assert "no frame on" in said[0]
    next(frame for frame in frames if way_of(taker) == "shm")
    seen = identities(frames, 10)
    assert seen == sorted(set(seen))


def test_the_router_may_go_and_come_back(client, router, service, taker):
    service("camera", *SMALL)
    frames = in_time(taker, iter(taker.frames(transport="auto")), 60)
    next(frame for frame in frames if way_of(taker) == "shm")
    router.kill()
    router.start()
    since = taker.counters.snapshot()["processed"]
    seen = identities(frames, 40)
    assert seen == sorted(set(seen))
    next(frame for frame in frames if way_of(taker) == "shm")
    assert taker.counters.snapshot()["processed"] > since


def test_shm_alone_takes_nothing_else_and_says_what_it_waits_for(client, service, taker):
    change(taker, "shm")
    frames = in_time(taker, iter(taker.frames(transport="shm")))
    (waiting,) = taker.inputs
    assert [state.key for state in waiting.states()] == [f"{COMPRESSED_KEY} in shared memory"]
    service("camera", *SMALL)
    assert next(frames).key == COMPRESSED_KEY
    assert way_of(taker) == "shm"
    assert not subscribed(client, COMPRESSED_KEY)


def test_inputs_that_are_told_nothing_take_it_unless_the_environment_says_otherwise(
    monkeypatch, service, connection
):
    service("camera", *SMALL)
    with Node("plain", connection=connection) as node:
        frames = in_time(node, iter(node.frames("image/compressed")))
        next(frame for frame in frames if way_of(node) == "shm")
        frames.close()
        monkeypatch.setenv("ZV_TRANSPORT", "jpeg")
        over_network = in_time(node, iter(node.frames("image/compressed")))
        assert identities(over_network, 10)
        assert way_of(node) == "jpeg"
        every = node.frames("image/compressed", buffering=queue(5))
        assert [state.key for state in every.states()] == [COMPRESSED_KEY]
        monkeypatch.setenv("ZV_TRANSPORT", "smh")
        with pytest.raises(ConfigurationError, match=r"ZV_TRANSPORT = 'smh'.*auto, shm, raw, jpeg"):
            node.frames("image/compressed")


def test_a_queue_takes_every_frame_over_the_network(service, taker):
    service("camera", *SMALL)
    frames = in_time(taker, iter(taker.frames(transport="auto", buffering=queue(100))))
    for _ in range(30):
        next(frames)
        assert way_of(taker) == "jpeg"


@pytest.fixture
def offer(client) -> Iterator[str]:
    """The key of an offer that a process of this user made, and whose name comes last."""
    key = shared_memory_key("vision", "front", machine_identity(), "z")
    bell = Doorbell.create(channel_name(key))
    with client.liveliness().declare_token(key):
        yield key
    bell.close()


def test_an_offer_that_cannot_be_taken_is_said_and_the_next_one_is(
    monkeypatch, client, service, taker, offer
):
    open_channel = reader.open_channel

    def refuse(name: str) -> tuple[Any, Any]:
        if name == channel_name(offer):
            raise SharedMemoryError("/dev/shm is full")
        return open_channel(name)

    monkeypatch.setattr(reader, "open_channel", refuse)
    frames = in_time(taker, iter(taker.frames()))
    with PlainCamera(client).at(30):
        said = "no frames of front through shared memory: /dev/shm is full"
        next(frame for frame in frames if said in taker.health.diagnostics().message)
        assert taker.health.diagnostics().level == Level.WARN
        assert way_of(taker) == "jpeg"
    service("camera", *SMALL)
    next(frame for frame in frames if way_of(taker) == "shm")
    assert "shared memory" not in taker.health.diagnostics().message


def test_false_offers_keep_none_away_however_many(client, service, taker):
    machine = machine_identity()
    false = [
        client.liveliness().declare_token(
            shared_memory_key("vision", "front", machine, f"zz{number}")
        )
        for number in range(300)
    ]
    service("camera", *SMALL)
    frames = in_time(taker, iter(taker.frames()))
    next(frame for frame in frames if way_of(taker) == "shm")
    assert "shared memory" not in taker.health.diagnostics().message
    assert len(false) == 300


def test_the_offer_of_another_camera_is_none_of_this_one(client, connection, service, taker):
    """Anyone can declare a token of one camera that ends like that of another."""
    service("camera", *SMALL)
    own = offers(client, "front")
    service("camera", *SMALL, "--camera", "left")
    (left,) = offers(client, "left")
    false = left.replace("/left/", "/front/")
    assert false > own[0], "the later one is preferred"
    with (
        client.liveliness().declare_token(false),
        Node("other", camera="left", connection=connection) as other,
    ):
        assert identities(in_time(other, iter(other.frames())), 10)
        frames = in_time(taker, iter(taker.frames()))
        next(frame for frame in frames if way_of(taker) == "shm")
        assert identities(frames, 10)
    assert "dropped.wrong_camera" not in taker.counters.snapshot()


def offers(client: zenoh.Session, camera: str) -> list[str]:
    pattern = shared_memory_key("vision", camera, machine_identity(), "*")
    tokens = client.liveliness()
    return wait_until(lambda: [str(reply.ok.key_expr) for reply in tokens.get(pattern)])


@pytest.mark.parametrize("told", ["jpeg", "raw"])
def test_a_camera_that_is_told_so_offers_no_shared_memory(monkeypatch, client, connection, told):
    pattern = shared_memory_key("vision", "front", machine_identity(), "*")
    tokens = client.liveliness()
    with Node("camera", connection=connection, publishes=["image"]):
        wait_until(lambda: list(tokens.get(pattern)))
    wait_until(lambda: not list(tokens.get(pattern)))
    monkeypatch.setenv("ZV_TRANSPORT", told)
    with Node("camera", connection=connection, publishes=["image"]):
        wait_for_nodes(client, "camera_front")
        assert not list(tokens.get(pattern))


def test_a_camera_refuses_a_transport_that_does_not_exist(monkeypatch):
    monkeypatch.setenv("ZV_TRANSPORT", "smh")
    with pytest.raises(ConfigurationError, match=r"ZV_TRANSPORT = 'smh'.*shm"):
        Node("camera", publishes=["image"])


def test_jpegs_of_a_source_come_through_shared_memory_as_they_are_and_decoded_once(
    client, connection, taker
):
    """A webcam's MJPEG: the camera decodes nothing, and the network carries nothing twice."""
    jpeg = encode_jpeg(np.full((240, 320, 3), 77, np.uint8), "bgr8", 90)
    with Node("camera", connection=connection, publishes=BOTH) as camera:
        feeding = Paced(60, lambda: camera.publish_picture("image/compressed", jpeg))
        with feeding:
            frames = in_time(taker, iter(taker.frames(transport="auto")))
            next(frame for frame in frames if way_of(taker) == "shm")
            next(frame for frame in frames if not subscribed(client, COMPRESSED_KEY))
            for _ in range(20):
                frame = next(frames)
                assert frame.compressed == jpeg
            assert not subscribed(client, RAW_KEY)
    counters = taker.counters.snapshot()
    assert counters.get("dropped.duplicate", 0) <= 30


def test_a_remote_consumer_beside_a_local_one_gets_jpeg(client, service, taker):
    service("camera", *SMALL)
    pictures: list[bytes] = []
    with client.declare_subscriber(
        COMPRESSED_KEY, lambda sample: pictures.append(sample.payload.to_bytes())
    ):
        frames = in_time(taker, iter(taker.frames(transport="auto")))
        next(frame for frame in frames if way_of(taker) == "shm")
        next(frame for frame in frames if len(pictures) > 20)
    assert all(picture.startswith(b"\xff\xd8") for picture in pictures)
