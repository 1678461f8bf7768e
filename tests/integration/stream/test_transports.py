"""A node's input from a camera that is not ours: raw pixels, compressed frames, or both."""

from __future__ import annotations

from typing import Annotated, ClassVar

import pytest
import zenoh
from pydantic import Field

from tests.support.listening import newest
from tests.support.publishing import RAW_PIXELS, Paced, PlainCamera, raw_frames
from tests.support.waiting import in_time, wait_until
from zenoh_vision import Connection, Live, Node, NodeDescription, ServiceSettings
from zenoh_vision.keys import Transport

COMPRESSED_KEY, RAW_KEY = "vision/r1/image/compressed", "vision/r1/image"


class TakerSettings(ServiceSettings):
    env_prefix: ClassVar[str] = "ZV_TAKER_"

    transport: Annotated[Transport, Field(description="key of the frames"), Live()] = "auto"


@pytest.fixture
def connection(router) -> Connection:
    return Connection(router.endpoint, timeout_s=10)


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


def test_a_running_node_switches_by_its_parameter(client, connection):
    settings = TakerSettings(camera="r1")
    with (
        client.declare_publisher(RAW_KEY) as raw,
        client.declare_publisher(COMPRESSED_KEY) as compressed,
        Node("taker", camera="r1", connection=connection, parameters=settings) as node,
        Paced(30, raw_frames(raw)),
    ):
        assert node.parameters is not None
        frames = in_time(node, iter(node.frames(transport=settings.transport)))
        assert wait_until(lambda: wanted(compressed))
        assert not wanted(raw), "who publishes both is not asked for the raw pixels"
        node.parameters.change({"transport": "raw"})
        assert next(frames).key == RAW_KEY
        wait_until(lambda: not wanted(compressed))


def test_a_transport_needs_the_frames_of_one_camera(connection):
    with Node("taker", camera="r1", connection=connection) as node:
        for topic, camera in (("image", None), ("image/compressed", "*")):
            with pytest.raises(ValueError, match="transport 'auto' needs image/compressed of one"):
                node.frames(topic, camera=camera, transport="auto")
