"""A node's input from a camera that is not ours: raw pixels, compressed frames, or both."""

from __future__ import annotations

import pytest
import zenoh

from tests.support.listening import newest
from tests.support.publishing import RAW_PIXELS, Paced, PlainCamera, raw_frames
from tests.support.waiting import in_time
from zenoh_vision import Node, NodeDescription

COMPRESSED_KEY, RAW_KEY = "vision/r1/image/compressed", "vision/r1/image"


def wanted(publisher: zenoh.Publisher) -> bool:
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]


def test_a_camera_that_publishes_only_raw_pixels_is_seen_until_it_sends_compressed_frames(
    client, connection
):
    with (
        client.declare_publisher(RAW_KEY) as raw,
        Node("taker", camera="r1", connection=connection) as node,
        Paced(30, raw_frames(raw)),
    ):
        frames = in_time(node, iter(node.frames(transport="auto")))
        assert (next(frames).bgr == RAW_PIXELS).all()
        said = NodeDescription.from_bytes(newest(client, "@vision/node/taker_r1").payload)
        assert said.subscribes == (COMPRESSED_KEY, RAW_KEY)
        with PlainCamera(client, camera="r1").at(30):  # of a newer epoch
            next(frame for frame in frames if frame.key == COMPRESSED_KEY)
            next(frame for frame in frames if not wanted(raw))


def test_a_transport_needs_the_frames_of_one_camera(connection):
    with Node("taker", camera="r1", connection=connection) as node:
        for topic, camera in (("image", None), ("image/compressed", "*")):
            with pytest.raises(ValueError, match="transport 'auto' needs image/compressed of one"):
                node.frames(topic, camera=camera, transport="auto")
