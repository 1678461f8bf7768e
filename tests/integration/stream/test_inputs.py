"""What a loop can take from: several inputs, cameras by wildcard, messages, parameters."""

from __future__ import annotations

import signal
import threading
from typing import ClassVar

import pytest

from tests.support.listening import newest, wait_for_nodes
from tests.support.publishing import PlainCamera
from tests.support.waiting import in_time, wait_until
from zenoh_vision import (
    Centroid,
    Diagnostics,
    Frame,
    Header,
    Message,
    Node,
    NodeDescription,
    message_topic,
    queue,
)
from zenoh_vision.config.revisions import ParameterStore
from zv.edge.settings import EdgeSettings


def test_one_loop_takes_frames_of_every_camera_and_messages_of_every_node(client, connection):
    cameras = [PlainCamera(client, camera=name) for name in ("door", "yard")]
    with (
        Node("mixer", camera=(), connection=connection) as node,
        cameras[0].at(30),
        cameras[1].at(30),
    ):
        inputs = (
            node.frames(camera="*", want="gray"),
            node.messages("@vision/diagnostics/*"),
            node.messages("centroid", camera="*", buffering=queue(5)),
        )
        seen: set[str] = set()
        for item in in_time(node, node.receive(*inputs), 15):
            match item:
                case Frame():
                    assert item.gray.ndim == 2
                    seen.add(item.header.camera)
                case Diagnostics():
                    seen.add(item.node)
            if seen == {"door", "yard", "mixer"}:
                break
        assert seen == {"door", "yard", "mixer"}
        counted = node.counters.snapshot()
        assert counted["processed"] > 2
        states = {state.key for each in node.health.inputs for state in each.states()}
        assert states == set(), "the loop's end closes its inputs"


def test_messages_of_a_topic_come_as_their_class(client, connection):
    header = PlainCamera(client).header()
    with (
        Node("sender", connection=connection, publishes=["centroid"]) as sender,
        Node("taker", connection=connection) as taker,
    ):
        centroids = taker.messages("centroid")
        said = newest(client, "@vision/node/taker_front").payload
        assert NodeDescription.from_bytes(said).subscribes == ("vision/front/centroid",)
        wait_until(lambda: sender.wanted("centroid"))
        made = Centroid.from_map(
            {"header": header, "x": 1, "y": 2, "box": (0, 0, 2, 2), "area": 4.0}
        )
        sender.publish("centroid", made)
        found = next(iter(in_time(taker, iter(centroids))))
        assert found == made


class Light(Message):
    schema_name: ClassVar[str] = "my.Light.v1"

    on: bool


LIGHT = message_topic("light", Light)


def test_a_message_without_a_header_is_published_for_the_camera_that_is_named(client, connection):
    with Node(
        "switch", camera=("door", "yard"), connection=connection, publishes=[LIGHT]
    ) as switch:
        switch.publish(LIGHT, Light(on=True), camera="yard")
        assert newest(client, "vision/yard/light").body == {"on": True}
        assert newest(client, "vision/yard/light").attachment is None
        with pytest.raises(ValueError, match=r"switch serves \('door', 'yard'\): name the camera"):
            switch.publish(LIGHT, Light(on=True))
    with Node("switch", camera="door", connection=connection, publishes=[LIGHT]) as switch:
        switch.publish(LIGHT, Light(on=False))
        assert newest(client, "vision/door/light").body == {"on": False}


def test_an_unpublished_key_and_an_unknown_topic_are_explained(connection):
    with Node("quiet", connection=connection, publishes=["centroid"]) as node:
        with pytest.raises(ValueError, match="quiet_front does not publish tracks of front"):
            node.wanted("tracks")
        with pytest.raises(ValueError, match="no topic 'picture'; known are image/compressed"):
            node.frames("picture")


def test_a_start_that_fails_half_way_leaves_nothing_open(client, connection, monkeypatch):
    before = signal.getsignal(signal.SIGTERM)
    threads = set(threading.enumerate())
    node = Node("broken", connection=connection, publishes=["centroid"])

    def fail() -> None:
        raise RuntimeError("half way")

    monkeypatch.setattr(node._announcement, "start", fail)
    with pytest.raises(RuntimeError, match="half way"), node:
        pass
    assert signal.getsignal(signal.SIGTERM) is before
    ours = {"queries", "link", "health"}
    wait_until(lambda: not {t.name for t in set(threading.enumerate()) - threads} & ours)
    with Node("broken", connection=connection):  # its name and keys are free
        wait_for_nodes(client, "broken_front")


def test_a_node_of_no_camera_is_called_as_its_service(connection, client):
    with Node("onlooker", camera=(), connection=connection) as node:
        wait_for_nodes(client, "onlooker")
        assert newest(client, "@vision/node/onlooker").body["cameras"] == []
        with pytest.raises(ValueError, match="serves no camera"):
            next(node.frames())
        with pytest.raises(ValueError, match="serves no camera"):
            _ = node.camera


def test_a_result_of_a_message_has_the_identity_of_its_frame_and_the_nodes_own_name(
    client, connection
):
    frame = Header(camera="front", epoch=3, seq=8, stamp_ns=5, width=64, height=48)
    header = frame.model_copy(update={"node": "finder", "revision": 9, "received_ns": 6})
    found = Centroid(header=header, found=False, x=None, y=None, box=None, area=None)
    parameters = ParameterStore(EdgeSettings())
    with (
        Node("finder", connection=connection, publishes=["centroid"]) as finder,
        Node("picker", connection=connection, parameters=parameters) as picker,
    ):
        results = in_time(picker, picker.messages("centroid"), 15)
        wait_until(lambda: finder.wanted("centroid"))
        finder.publish("centroid", found)
        own = picker.header(next(results))
        revision = parameters.change({"low": 7.0}).after.number
        wait_until(lambda: finder.publish("centroid", found))
        changed = picker.header(next(results))
    assert (own.camera, own.epoch, own.seq, own.stamp_ns, own.width) == ("front", 3, 8, 5, 64)
    assert (own.node, own.revision) == ("picker_front", 0)
    assert own.received_ns is None  # when the frame came, by the clock of another node
    assert changed.revision == revision
