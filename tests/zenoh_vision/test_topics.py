"""The topic table is the contract's, row by row."""

from __future__ import annotations

import pytest
import zenoh

from zenoh_vision import keys
from zenoh_vision.topics import TOPICS, misnamed_camera

STAGES = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")

# name: Zenoh encoding, how it competes, made only when wanted
TABLE = {
    "image/compressed": ("image/jpeg", "frame", True),
    "image": ("application/octet-stream;vision.Image.v1", "frame", True),
    "camera_info": ("application/msgpack;vision.CameraInfo.v1", "message", False),
    "centroid": ("application/msgpack;vision.Centroid.v1", "message", False),
    "tracks": ("application/msgpack;vision.Tracks.v1", "message", False),
    "events": ("application/msgpack;vision.TrackEvent.v1", "message", False),
    "prediction": ("application/msgpack;vision.Prediction.v1", "message", True),
    "tracked/compressed": ("image/jpeg", "frame", True),
    "mask/compressed": ("image/png", "frame", True),
    "background/compressed": ("image/jpeg", "frame", True),
    "relayed/compressed": ("image/jpeg", "frame", True),
    "edges/compressed": ("image/png", "frame", True),
    **{f"edges/{stage}/compressed": ("image/png", "frame", True) for stage in STAGES},
    "edges/contours": ("application/msgpack;vision.Contours.v1", "frame", True),
    "replay": ("application/msgpack;vision.Replay.v1", "message", False),
    "truth": ("application/msgpack;vision.Tracks.v1", "message", False),
}


def test_the_table_has_exactly_the_contracts_rows():
    assert set(TOPICS) == set(TABLE)


@pytest.mark.parametrize("name", TABLE)
def test_a_row_is_the_contracts(name: str):
    topic = TOPICS[name]
    assert (topic.encoding, topic.delivery, topic.lazy) == TABLE[name]
    assert topic.key("vision", "front") == f"vision/front/{name}"
    assert topic.name == name


@pytest.mark.parametrize("name", TABLE)
def test_a_key_is_a_canonical_key_expression_of_its_camera_alone(name: str):
    key = TOPICS[name].key("plant_2", "rear")
    assert key.startswith("plant_2/rear/")
    assert str(zenoh.KeyExpr.autocanonize(key)) == key
    assert zenoh.KeyExpr("plant_2/rear/**").includes(zenoh.KeyExpr(key))


def test_no_two_topics_share_a_key():
    assert len({topic.name for topic in TOPICS.values()}) == len(TOPICS)


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        (keys.node_key("vision", "tracker_front"), "@vision/node/tracker_front"),
        (keys.diagnostics_key("vision", "camera_front"), "@vision/diagnostics/camera_front"),
        (keys.schema_key("vision", "Centroid"), "@vision/schema/Centroid"),
    ],
    ids=["node", "diagnostics", "schema"],
)
def test_what_is_about_nodes_is_hidden_from_wildcards(key: str, expected: str):
    assert key == expected
    for wild in ("**", "*/**", "vision/**"):
        assert not zenoh.KeyExpr(wild).intersects(zenoh.KeyExpr(key))


@pytest.mark.parametrize("name", ["front", "cam_2", "0", "_", "a" * 64])
def test_these_are_names(name: str):
    assert keys.is_name(name)


@pytest.mark.parametrize(
    "name", ["", "Front", "front/left", "front-left", "*", "@front", "früh", "front\n", "a b", "$*"]
)
def test_these_are_no_names(name: str):
    assert not keys.is_name(name)


@pytest.mark.parametrize(
    ("key", "camera"),
    [
        ("vision/cam-1/image/compressed", "cam-1"),
        ("vision/Front/image", "Front"),
        ("vision/front/image/compressed", ""),
        ("vision/*/image/compressed", ""),
        ("vision/cam-1/centroid", ""),
        ("other/cam-1/image", ""),
        ("vision/cam-1/image/" + "x" * 200, ""),
    ],
)
def test_a_camera_whose_name_is_none_is_known_by_its_frames(key: str, camera: str):
    assert misnamed_camera(key, "vision") == camera
