"""Every stream key answers ``get`` with its newest sample, and nothing is made for nobody."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np
import pytest
import zenoh

from tests.support.listening import Listener, Message, ask, balance, newest, wait_for_nodes
from tests.support.pictures.encoded import HEIGHT, WIDTH, scene
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zenoh_vision.node.node import Node

# The camera's last frame is its 20th: after it, the newest sample of every stream stays.
STALLED = ("--faults", "stall@20+999999", "--stall-after", 3600, "--rate", 20)
SMALL = ("--width", 320, "--height", 240)

CAMERA_KEYS = {
    "image/compressed": "image/jpeg",
    "image": "application/octet-stream;vision.Image.v1",
    "truth": "application/msgpack;vision.Tracks.v1",
}
DERIVED_KEYS = {
    "centroid": "application/msgpack;vision.Centroid.v1",
    "tracked/compressed": "image/jpeg",
    "mask/compressed": "image/png",
    "edges/compressed": "image/png",
}


def last_of(session: zenoh.Session, suffix: str, seq: int) -> Message:
    """Return the snapshot of a key as soon as it is of a frame."""

    def reached() -> Message | None:
        return next(
            (
                found
                for found in ask(session, f"vision/front/{suffix}")
                if found.header["seq"] == seq
            ),
            None,
        )

    return wait_until(reached, 15, lambda: f"{suffix} never came to {seq}")


def test_a_camera_answers_with_its_newest_frame_also_when_nobody_subscribes(client, service):
    service("camera", *STALLED, *SMALL)
    found = {suffix: last_of(client, suffix, 19) for suffix in CAMERA_KEYS}
    assert {suffix: message.encoding for suffix, message in found.items()} == CAMERA_KEYS
    assert found["image"].attachment == found["image/compressed"].attachment
    pixels = np.frombuffer(found["image"].payload, np.uint8).reshape(240, 320, 3)
    decoded = cv2.imdecode(
        np.frombuffer(found["image/compressed"].payload, np.uint8), cv2.IMREAD_COLOR
    )
    assert np.abs(pixels.astype(int) - decoded).mean() < 5


@pytest.mark.parametrize("subscribed", [True, False], ids=["subscribed", "nobody subscribes"])
def test_derived_streams_answer_with_the_very_sample_that_was_published(
    client, service, subscribed
):
    for name in ("tracker", "edge"):  # the last frame is never too late, however busy the machine
        service(name, "--max-age", 30)
    wait_for_nodes(client, "tracker_front", "edge_front")
    listeners = {
        suffix: Listener(client, f"vision/front/{suffix}") for suffix in DERIVED_KEYS if subscribed
    }
    camera = PlainCamera(client)
    with camera.at(20):
        Listener(client, "vision/front/centroid").wait_for(10)
        for listener in listeners.values():
            listener.wait_for(1)
    last = camera.seq - 1
    for suffix, encoding in DERIVED_KEYS.items():
        assert last_of(client, suffix, last).encoding == encoding
    if not subscribed:
        return
    with camera.at(5):  # a frame may be lost on its way to a subscriber, but not each of them
        for suffix, listener in listeners.items():
            snapshot, published = wait_until(partial(twins, client, suffix, listener))
            assert snapshot.payload == published.payload
            assert snapshot.attachment == published.attachment
            assert snapshot.encoding == published.encoding


def twins(client, suffix: str, listener: Listener) -> tuple[Message, Message] | None:
    """Return a snapshot and the sample of the same frame that the listener got, if it has it."""
    snapshot = newest(client, f"vision/front/{suffix}")
    published = {message.header["seq"]: message for message in listener.messages}
    found = published.get(snapshot.header["seq"])
    return None if found is None else (snapshot, found)


def test_a_camera_that_nobody_listens_to_says_that_it_published_nothing(client, quick_service):
    quick_service("camera", "--rate", 20, *SMALL)
    health = Listener(client, "@vision/diagnostics/camera_front")
    wait_until(lambda: newest_counters(health).get("dropped.no_subscriber"))
    unheard = newest_counters(health)
    assert unheard["published"] == 0
    # A busy machine overwrites a frame before it finds that nobody wants it.
    reasons = {name for name in unheard if name.startswith("dropped.")}
    assert reasons <= {"dropped.no_subscriber", "dropped.overwritten"}
    assert balance(unheard) == 0
    listener = Listener(client, "vision/front/image/compressed")
    listener.wait_for(15)
    health.wait_for(1, after_s=time.monotonic())
    listener.close()
    # Whoever answers this has heard before that nobody subscribes any more.
    (answer,) = ask(client, "vision/front/image/compressed")
    seen = [message.header["seq"] for message in listener.messages]
    unaware = max(0, answer.header["seq"] - seen[-1])

    def settled() -> dict[str, int] | None:
        reports = [each.body["counters"] for each in health.since(answer.at_s)[-2:]]
        published = {each["published"] for each in reports}
        return reports[-1] if len(reports) == 2 and len(published) == 1 else None

    counters = wait_until(settled)
    # At the two ends of a subscription a frame may be put that the subscriber does not see: until
    # the camera hears of the end, and until it looks, ten times a second, whether someone listens.
    assert len(seen) <= counters["published"] <= len(seen) + unaware + 3


def newest_counters(health: Listener) -> dict[str, int]:
    """Return those of the newest report, if one came."""
    return health.messages[-1].body["counters"] if health.messages else {}


class Encoders:
    """Counts the encoder calls of this process."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.calls = {"encode_jpeg": 0, "encode_png": 0, "to_raw": 0}
        for name in self.calls:
            module = pixel_formats if name == "to_raw" else codecs
            patch.setattr(module, name, self._counting(name, getattr(module, name)))

    def _counting(self, name, encode):
        lock = threading.Lock()

        def counted(*arguments, **options):
            with lock:
                self.calls[name] += 1
            return encode(*arguments, **options)

        return counted


class OwnCamera:
    """A camera of this process, whose encoders can be counted."""

    def __init__(self, node: Node, encoding: str = "bgr8") -> None:
        self.node = node
        self.seq = 0
        self.epoch = time.time_ns()
        self._encoding = encoding

    def send(self) -> bool:
        pixels = scene(self.seq)
        header = Header(
            camera="front",
            epoch=self.epoch,
            seq=self.seq,
            stamp_ns=time.time_ns(),
            width=WIDTH,
            height=HEIGHT,
            encoding=self._encoding,
            node=self.node.name,
        )
        self.seq += 1
        return self.node.publish_picture("image/compressed", Frame(header, pixels))


@pytest.fixture
def camera(connection) -> Iterator[OwnCamera]:
    with Node("camera", connection=connection, publishes=["image/compressed", "image"]) as node:
        yield OwnCamera(node)


@pytest.fixture
def encoders(monkeypatch: pytest.MonkeyPatch) -> Encoders:
    return Encoders(monkeypatch)


def test_a_frame_is_encoded_once_for_any_number_of_listeners_and_snapshots(
    client, camera, encoders
):
    listeners = [Listener(client, "vision/front/image/compressed") for _ in range(3)]
    wait_until(camera.send)
    sent = camera.seq
    assert encoders.calls["encode_jpeg"] == 1  # all before it went to nobody
    for _ in range(5):
        newest(client, "vision/front/image/compressed")
    assert encoders.calls == {"encode_jpeg": 1, "encode_png": 0, "to_raw": 0}
    for listener in listeners:
        assert listener.wait_for(1)[0].header["seq"] == sent - 1
        listener.close()


def test_a_snapshot_alone_encodes_the_frame_that_it_answers_and_only_when_asked(
    client, camera, encoders
):
    for _ in range(10):
        camera.send()
    for _ in range(3):
        assert newest(client, "vision/front/image/compressed").header["seq"] == 9
    assert encoders.calls == {"encode_jpeg": 1, "encode_png": 0, "to_raw": 0}


def test_the_raw_key_is_put_only_while_someone_subscribes_to_it(client, camera, encoders):
    compressed = Listener(client, "vision/front/image/compressed")
    wait_until(camera.send)
    for _ in range(5):
        camera.send()
    assert encoders.calls["to_raw"] == 0
    raw = Listener(client, "vision/front/image")

    def arrives() -> list[Message]:
        camera.send()
        return raw.messages

    wait_until(arrives)
    assert encoders.calls["to_raw"] >= 1
    raw.close()

    def quiet() -> bool:
        before = encoders.calls["to_raw"]
        camera.send()
        return encoders.calls["to_raw"] == before

    wait_until(quiet)
    before = dict(encoders.calls)
    for _ in range(5):
        camera.send()
    assert encoders.calls["to_raw"] == before["to_raw"]
    assert encoders.calls["encode_jpeg"] == before["encode_jpeg"] + 5
    compressed.close()


@pytest.mark.quiet
def test_a_key_that_has_nothing_yet_answers_nothing_at_once(client, camera):
    started_s = time.monotonic()
    assert ask(client, "vision/front/image/compressed", timeout_s=5) == []
    assert time.monotonic() - started_s < 1


def test_results_that_nobody_wants_are_put_off_until_a_query_asks_for_the_newest(
    client, connection
):
    published: list[tuple[str, int]] = []
    topics = ["mask/compressed", "edges/compressed"]
    cameras = ("left", "right")
    with Node("edge", camera=cameras, connection=connection, publishes=topics) as node:

        def offer(seq: int) -> None:
            for camera in cameras:
                gray = np.full((48, 64), seq, np.uint8)
                head = Header(camera=camera, epoch=1, seq=seq, stamp_ns=1, width=64, height=48)
                node.publish_if_wanted(Frame(head, gray), partial(publish, Frame(head, gray)))

        def publish(frame: Frame) -> None:
            published.append((frame.header.camera, frame.header.seq))
            for topic in topics:
                node.publish_picture(topic, frame.gray, frame=frame)

        offer(1)
        offer(2)
        assert not published
        for topic in topics:
            for camera in cameras:
                assert newest(client, f"vision/{camera}/{topic}").header["seq"] == 2
        assert sorted(published) == [("left", 2), ("right", 2)]
        listener = Listener(client, "vision/left/mask/compressed")
        wait_until(lambda: node.wanted("mask/compressed", "left"))
        offer(3)
        assert published[2:] == [("left", 3), ("right", 3)]
        assert [each.header["seq"] for each in listener.wait_for(1)] == [3]
        assert newest(client, "vision/right/edges/compressed").header["seq"] == 3
        assert len(published) == 4


def test_results_are_not_put_off_where_one_is_always_sent(client, connection):
    topics = ["centroid", "mask/compressed"]
    published: list[int] = []
    with Node("tracker", connection=connection, publishes=topics) as node:
        head = Header(camera="front", epoch=1, seq=7, stamp_ns=1, width=64, height=48)
        frame = Frame(head, np.zeros((48, 64), np.uint8))
        node.publish_if_wanted(frame, lambda: published.append(frame.header.seq))
    assert published == [7]
