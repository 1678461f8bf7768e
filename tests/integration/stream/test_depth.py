"""Depth from a publisher to a consumer: its wire form, and the range of a node's settings."""

from __future__ import annotations

import math
import time

import msgpack
import numpy as np

from tests.support.headers import header
from tests.support.listening import Listener, open_client
from tests.support.publishing import Paced, wait_for_subscriber
from tests.support.waiting import in_time, wait_until
from zenoh_vision import Frame, Header, Node
from zenoh_vision.image import codecs
from zenoh_vision.image.depth import ValueRange
from zenoh_vision.topics import COMPRESSED, RAW
from zv.tracker.settings import TrackerSettings

KEY = "vision/front/image/compressed"
ROOM = np.array([[0, 2000, 2500, 3000]], np.uint16)
METRES = np.array([[math.nan, 2.0, 2.5, 3.0]], np.float32)


def header_now(seq: int, encoding: str, width: int = 4, height: int = 1) -> Header:
    changes = {"width": width, "height": height, "encoding": encoding}
    return header(seq, stamp_ns=time.time_ns(), **changes)


def test_depth_in_metres_is_sent_raw_in_metres_and_compressed_in_millimetres(client, connection):
    compressed, raw = Listener(client, KEY), Listener(client, "vision/front/image")
    with Node("camera", connection=connection, publishes=[COMPRESSED, RAW]) as camera:
        frame = Frame(header_now(0, "32FC1"), METRES)
        wait_until(
            lambda: (
                camera.publish_picture("image/compressed", frame)
                and compressed.messages
                and raw.messages
            )
        )
    sent = raw.messages[0]
    assert sent.header["encoding"] == "32FC1"
    assert sent.payload == METRES.astype("<f4").tobytes()
    sent = compressed.messages[0]
    assert (sent.encoding, sent.header["encoding"]) == ("image/png", "16UC1")
    assert codecs.decode_png(sent.payload).tolist() == ROOM.tolist()


def test_a_nodes_settings_say_which_values_become_8_bits(client, connection):
    numbers = iter(range(10**6))

    def send() -> None:
        attachment = header_now(next(numbers), "16UC1").to_bytes()
        client.put(KEY, codecs.encode_png(ROOM), encoding="image/png", attachment=attachment)

    with (
        Node("tracker", connection=connection, parameters=TrackerSettings()) as node,
        Paced(30, send),
    ):
        assert node.parameters is not None
        frames = in_time(node, iter(node.frames(want="gray")))
        frame = next(frames)
        assert frame.value_range == ValueRange(2000, 3000)
        assert frame.gray.tolist() == [[0, 1, 128, 255]]
        node.parameters.change({"depth_min": 2500, "depth_max": 5040})
        frame = next(frame for frame in frames if frame.revision.number == 1)
        # 3000 is 1 + 254 * 500 / 2540 = 51
        assert frame.gray.tolist() == [[0, 1, 1, 51]]


def test_a_node_without_these_settings_gets_16_bits_scaled_as_a_whole(client, connection):
    with Node("taker", connection=connection) as node:
        frames = in_time(node, iter(node.frames(want="gray")))
        wait_for_subscriber(client, KEY)
        attachment = header_now(0, "mono16").to_bytes()
        client.put(KEY, codecs.encode_png(ROOM), encoding="image/png", attachment=attachment)
        assert next(frames).gray.tolist() == [[0, 8, 10, 12]]


def test_a_tracker_of_depth_publishes_centroids(router, service, client):
    service("tracker", "--pipeline", "tutorial", "--history", 20)
    centroids = Listener(client, "vision/front/centroid")
    noise = np.random.default_rng(1)
    numbers = iter(range(10**6))

    def send() -> None:
        seq = next(numbers)
        room = noise.normal(2900, 3, (120, 160)).astype(np.uint16)
        if seq > 60:
            left = 10 + 4 * (seq % 25)
            room[40:80, left : left + 30] = 2300
        attachment = header_now(seq, "16UC1", 160, 120).to_bytes()
        client.put(KEY, codecs.encode_png(room), encoding="image/png", attachment=attachment)

    with open_client(router.endpoint) as other, Paced(30, send):
        wait_for_subscriber(other, KEY)
        wait_until(lambda: any(each.body["x"] is not None for each in centroids.messages[-5:]))
    found = next(each.body for each in centroids.messages if each.body["x"] is not None)
    assert 40 <= found["y"] <= 80
    assert msgpack.unpackb(centroids.messages[0].attachment)["camera"] == "front"
