"""The tracker's messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zenoh_vision.node.node import Node
from zv.tracker.camera_tracking import centroid_of
from zv.tracker.camera_tracking import largest_parameters as parameters_of
from zv.tracker.pipelines.largest import LargestObject, MovingObject
from zv.tracker.settings import TrackerSettings

FRAME = Frame(
    Header(
        camera="rear",
        epoch=5,
        seq=41,
        stamp_ns=7,
        width=160,
        height=120,
        encoding="bgr8",
        node="camera_rear",
        received_ns=9,
    ),
    pixels=np.zeros((120, 160, 3), np.uint8),
)


@pytest.fixture
def node() -> Node:
    live = ParameterStore(TrackerSettings())
    for history in (5, 6, 7):
        live.change({"history": history})
    FRAME.revision = live.activate()
    return Node("tracker", camera="rear", parameters=live)


def test_a_centroid_contains_the_detected_object(node: Node):
    centroid = centroid_of(node, FRAME, MovingObject((60, 40, 31, 30), 841.5))
    # 60 + int(31 / 2) = 75, 40 + int(30 / 2) = 55
    assert (centroid.x, centroid.y) == (75, 55)
    assert (centroid.box, centroid.area) == ((60, 40, 31, 30), 841.5)


def test_a_centroid_without_an_object_has_nil_fields(node: Node):
    centroid = centroid_of(node, FRAME, None)
    assert (centroid.x, centroid.y, centroid.box, centroid.area) == (None,) * 4


@pytest.mark.parametrize("found", [None, MovingObject((0, 0, 1, 1), 0.0)], ids=["none", "one"])
def test_a_centroid_has_the_identity_of_its_frame_and_the_name_of_its_node(
    node: Node, found: MovingObject | None
):
    header = centroid_of(node, FRAME, found).header
    source = FRAME.header
    assert (header.camera, header.epoch, header.seq, header.stamp_ns) == ("rear", 5, 41, 7)
    assert (header.width, header.height, header.received_ns) == (160, 120, 9)
    assert (header.node, header.revision) == ("tracker_rear", 3)
    assert header.encoding is None
    assert header.done_ns is not None
    assert source.done_ns is None


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("history", 30),
        ("var_threshold", 4.0),
        ("detect_shadows", False),
        ("closing", 3),
        ("median", 9),
        ("threshold", 126),
    ],
)
def test_every_setting_reaches_the_tracker(name: str, value: object):
    tutorial = parameters_of(TrackerSettings())
    by_setting = LargestObject(parameters_of(TrackerSettings.model_validate({name: value})))
    by_hand = LargestObject(replace(tutorial, **{name: value}))
    default = LargestObject(tutorial)
    noise = np.random.default_rng(5)
    differs = False
    for k in range(60):
        frame = noise.normal(90, 4, (90, 120, 3)).clip(0, 255).astype(np.uint8)
        if k > 10:
            frame[10:24, k : k + 14] = 200
            frame[50:75, 110 - k : 130 - k] = (60, 60, 62)
        found, mask = by_setting.update(frame)
        expected, expected_mask = by_hand.update(frame)
        assert found == expected
        assert np.array_equal(mask, expected_mask)
        differs |= not np.array_equal(mask, default.update(frame)[1])
    assert differs
