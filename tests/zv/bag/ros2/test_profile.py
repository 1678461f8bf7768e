"""A recording for ROS 2 is read by programs that know nothing of this project."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import msgpack
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.zv.bag.records import frame, header, message
from zv.bag.editing import opened, write
from zv.bag.record import Record, RecordingError
from zv.bag.recording import Recording
from zv.bag.report import report_of
from zv.bag.ros2.cdr import cdr
from zv.bag.ros2.messages import HASHES, TYPES, definition, ros_name

CALIBRATION = {
    "width": 4,
    "height": 2,
    "distortion_model": "plumb_bob",
    "d": [0.1, -0.2, 0.0, 0.0, 0.5],
    "k": [100.0, 0, 2, 0, 101, 1, 0, 0, 1],
    "r": [1.0, 0, 0, 0, 1, 0, 0, 0, 1],
    "p": [100.0, 0, 2, 0, 0, 101, 1, 0, 0, 0, 1, 0],
}
TRACK = {"id": 7, "state": "confirmed", "x": 2.0, "y": 1.0, "box": [1, 0, 2, 2], "area": 4.0}


def packed(name: str, schema: str, fields: dict[str, object]) -> Record:
    own = msgpack.unpackb(header(3))
    return replace(
        message(3, name, schema), payload=bytes(msgpack.packb({**fields, "header": own}))
    )


def records() -> list[Record]:
    return [
        frame(3),
        replace(
            frame(3),
            key="vision/front/image",
            payload=bytes(range(24)),
            encoding="application/octet-stream;vision.Image.v1",
        ),
        packed("camera_info", "vision.CameraInfo.v1", CALIBRATION),
        packed("tracks", "vision.Tracks.v1", {"tracks": [TRACK]}),
        packed(
            "centroid", "vision.Centroid.v1", {"x": 2, "y": 1, "box": [1, 0, 2, 2], "area": 4.0}
        ),
        message(4, "events", "vision.TrackEvent.v1"),
    ]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write(records(), tmp_path / "ros.mcap", {"namespace": "vision"}, profile="ros2")
    return tmp_path / "ros.mcap"


def test_mcap_s_own_decoder_reads_every_message(path: Path) -> None:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        found = {
            channel.topic: (schema, channel, decoded)
            for schema, channel, _, decoded in reader.iter_decoded_messages()
        }
    assert {schema.encoding for schema, _, _ in found.values()} == {"ros2msg"}
    assert {channel.message_encoding for _, channel, _ in found.values()} == {"cdr"}
    image = found["/vision/front/image/compressed"][2]
    assert bytes(image.data) == frame(3).payload
    assert (image.format, image.header.frame_id) == ("jpeg", "front")
    stamp = image.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == frame(3).number("stamp_ns")
    raw = found["/vision/front/image"][2]
    assert (raw.height, raw.width, raw.step, raw.encoding) == (2, 4, 12, "bgr8")
    assert bytes(raw.data) == bytes(range(24))
    info = found["/vision/front/camera_info"][2]
    assert list(info.d) == CALIBRATION["d"]
    assert list(info.p) == CALIBRATION["p"]
    point = found["/vision/front/centroid"][2].point
    assert (point.x, point.y) == (2.0, 1.0)
    boxes = found["/vision/front/tracks/boxes"][2]
    assert [(each.x, each.y) for each in boxes.points[0].points] == [(1, 0), (3, 0), (3, 2), (1, 2)]
    assert boxes.texts[0].text == "7"
    assert "/vision/front/events" not in found


def test_rosbags_reads_pictures_detections_and_calibration(path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([path], default_typestore=store) as reader:
        found = {
            connection.topic: reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
        }
    assert found["/vision/front/image/compressed"].data.tobytes() == frame(3).payload
    (detection,) = found["/vision/front/tracks"].detections
    assert (detection.id, detection.bbox.center.position.x, detection.bbox.size_x) == (
        "7",
        2.0,
        2.0,
    )
    assert detection.results[0].hypothesis.class_id == "confirmed"
    assert found["/vision/front/camera_info"].k.tolist() == CALIBRATION["k"]


@pytest.mark.parametrize("wrong", [{"d": True}, {"k": 5}, {"p": ["a"] * 12}, {"width": -1}])
def test_a_calibration_that_ros_cannot_hold_is_left_out(
    tmp_path: Path, wrong: dict[str, object]
) -> None:
    record = packed("camera_info", "vision.CameraInfo.v1", CALIBRATION | wrong)
    assert write([record, frame(4)], tmp_path / "ros.mcap", {}, profile="ros2") == 1


def test_types_have_the_hashes_that_ros_computes() -> None:
    store = get_typestore(Stores.EMPTY)
    for name, text in ((name, definition(name)) for name in TYPES):
        types = get_types_from_msg(text, ros_name(name))
        store.register({each: types[each] for each in types if each not in store.fielddefs})
    for name, expected in HASHES.items():
        assert store.hash_rihs01(ros_name(name)) == f"RIHS01_{expected}"


def test_cdr_is_byte_for_byte_that_of_another_encoder() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = store.types
    for frame_id in ("", "a", "front", "camera_2"):
        ours = cdr(
            "sensor_msgs/CameraInfo",
            {
                "header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": frame_id},
                **CALIBRATION,
                "roi": {"x_offset": 9, "do_rectify": True},
            },
        )
        head = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](5, 6), frame_id)
        roi = kinds["sensor_msgs/msg/RegionOfInterest"](9, 0, 0, 0, True)
        arrays = [np.array(CALIBRATION[name], np.float64) for name in "dkrp"]
        theirs = kinds["sensor_msgs/msg/CameraInfo"](head, 2, 4, "plumb_bob", *arrays, 0, 0, roi)
        assert ours == bytes(store.serialize_cdr(theirs, "sensor_msgs/msg/CameraInfo"))


def test_what_needs_the_samples_refuses_it_and_says_what_to_do(path: Path) -> None:
    with ExitStack() as stack:
        recording = stack.enter_context(Recording(path))
        assert report_of(recording).is_closed
        for refused in (recording.keys, lambda: opened([path], stack)):
            with pytest.raises(RecordingError, match=r"is for ROS 2.*`zv bag import`"):
                refused()
