"""A node that serves several cameras, or none."""

from __future__ import annotations

import pytest

from tests.support.listening import Listener, newest, wait_for_nodes
from tests.support.publishing import PlainCamera
from tests.support.waiting import in_time
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection


def test_a_node_of_two_cameras_takes_and_publishes_frames_of_each(router, client):
    connection = Connection(router.endpoint, timeout_s=10)
    cameras = {name: PlainCamera(client, camera=name) for name in ("door", "yard")}
    with Node(
        "seer", camera=("door", "yard"), connection=connection, publishes=["edges/compressed"]
    ) as node:
        wait_for_nodes(client, "seer")
        description = newest(client, "@vision/node/seer").body
        assert description["cameras"] == ["door", "yard"]
        assert description["publishes"] == [f"vision/{name}/edges/compressed" for name in cameras]
        for name, camera in cameras.items():
            edges = Listener(client, f"vision/{name}/edges/compressed")
            with camera.at(30):
                for frame in in_time(
                    node, node.frames("image/compressed", want="gray", camera=name)
                ):
                    assert frame.header.camera == name
                    node.publish_picture("edges/compressed", frame, frame.gray, encoding="mono8")
                    if edges.messages:
                        break
            assert edges.messages[0].header["camera"] == name
            assert edges.messages[0].header["node"] == "seer"


def test_a_node_of_no_camera_is_called_as_its_service(router, client):
    with Node("onlooker", camera=(), connection=Connection(router.endpoint)) as node:
        wait_for_nodes(client, "onlooker")
        assert newest(client, "@vision/node/onlooker").body["cameras"] == []
        with pytest.raises(ValueError, match="serves no camera"):
            next(node.frames())
        with pytest.raises(ValueError, match="serves no camera"):
            _ = node.camera
