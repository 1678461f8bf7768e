"""Samples as messages of ROS 2."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import cache
from typing import Any, Final

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.message_codec import unpack
from zv.bag.derived import numbers_of
from zv.bag.layout import PIXEL_BYTES
from zv.bag.record import Record
from zv.bag.ros2.cdr import cdr
from zv.bag.ros2.messages import HASHES, definition, ros_name
from zv.bag.schemas import Schema
from zv.bag.writer import Writer

PROFILE: Final = "ros2"
FOREVER: Final = "    sec: 9223372036\n    nsec: 854775807\n"
QOS: Final = (
    "- history: 1\n  depth: 10\n  reliability: 1\n  durability: {durability}\n"
    f"  deadline:\n{FOREVER}  lifespan:\n{FOREVER}  liveliness: 1\n"
    f"  liveliness_lease_duration:\n{FOREVER}  avoid_ros_namespace_conventions: false"
)
TRANSIENT, VOLATILE = 1, 2
MAX_STAMP_NS: Final = 2**31 * 10**9
GREEN: Final = {"r": 0.1, "g": 0.9, "b": 0.2, "a": 1.0}
WHITE: Final = {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0}
LINE_LOOP: Final = 2

Message = tuple[str, str, dict[str, Any]]
"""Suffix of the topic, name of the message, its fields."""


def has_ros2(record: Record) -> bool:
    """Tell whether ROS has a message for samples like this."""
    named = ("vision.CameraInfo.v1", "vision.Centroid.v1", "vision.Tracks.v1")
    return (
        record.encoding.startswith("image/")
        or record.encoding == RAW_IMAGE
        or record.encoding.endswith(named)
    )


def add_ros2(writer: Writer, record: Record) -> bool:
    """Add the messages of ROS for a sample; return whether there is one.

    Raises:
        ChunkLost: As for ``Writer.add_message``.
    """
    lost_with: Record | None = record
    stamp_ns = record.number("stamp_ns")
    publish_ns = record.log_time_ns if stamp_ns is None else stamp_ns
    for suffix, name, fields in messages_of(record):
        try:
            data = cdr(name, fields)
        except (struct.error, UnicodeError, OverflowError, TypeError):
            continue  # values that no message of ROS can hold
        latched = name == "sensor_msgs/CameraInfo"
        metadata = {
            "offered_qos_profiles": QOS.format(durability=TRANSIENT if latched else VOLATILE)
        }
        if name in HASHES:
            metadata["topic_type_hash"] = f"RIHS01_{HASHES[name]}"
        topic = f"/{record.key.replace('@', '')}{suffix}"
        writer.add_message(
            topic, schema_of(name), (data,), record.log_time_ns, publish_ns, 0, metadata, lost_with
        )
        lost_with = None  # a sample is lost once, with the first of its messages
    return lost_with is None


@cache
def schema_of(name: str) -> Schema:
    """Return the schema of a message of ROS."""
    return Schema(ros_name(name), "", "cdr", "ros2msg", definition(name).encode())


def messages_of(record: Record) -> Iterator[Message]:
    """Yield the messages for a sample; none for one that ROS has no message for."""
    if record.deleted:
        return
    header = record.header
    if record.encoding.startswith("image/"):
        form = record.encoding.removeprefix("image/").partition(";")[0]
        image = {"header": _header(header, record), "format": form, "data": record.payload}
        yield "", "sensor_msgs/CompressedImage", image
    elif record.encoding == RAW_IMAGE:
        yield from _raw(record)
    elif record.encoding.startswith("application/msgpack;vision."):
        try:
            fields = unpack(record.payload)
        except PayloadError:
            return
        if isinstance(fields, dict) and isinstance(fields.get("header"), dict):
            yield from _message(record, fields)


def _raw(record: Record) -> Iterator[Message]:
    width, height = record.number("width") or 0, record.number("height") or 0
    encoding = str(record.header.get("encoding"))
    step = width * PIXEL_BYTES.get(encoding, 0)
    if step and step * height == len(record.payload):
        yield (
            "",
            "sensor_msgs/Image",
            {
                "header": _header(record.header, record),
                "height": height,
                "width": width,
                "encoding": encoding,
                "step": step,
                "data": record.payload,
            },
        )


def _message(record: Record, fields: dict[Any, Any]) -> Iterator[Message]:
    header = _header(fields["header"], record)
    schema = record.encoding.partition(";")[2]
    if schema == "vision.CameraInfo.v1":
        names = ("height", "width", "distortion_model", "d", "k", "r", "p")
        if all(name in fields for name in names):
            wanted = {each: fields[each] for each in names}
            yield "", "sensor_msgs/CameraInfo", {"header": header, **wanted}
    elif schema == "vision.Centroid.v1" and numbers_of((fields.get("x"), fields.get("y"))):
        point = {"x": fields["x"], "y": fields["y"], "z": 0.0}
        yield "", "geometry_msgs/PointStamped", {"header": header, "point": point}
    elif schema == "vision.Tracks.v1" and isinstance(fields.get("tracks"), tuple):
        boxes = [
            each
            for each in fields["tracks"]
            if isinstance(each, dict) and numbers_of(each.get("box"), 4)
        ]
        detections = [_detection(each, header) for each in boxes]
        yield "", "vision_msgs/Detection2DArray", {"header": header, "detections": detections}
        yield "/boxes", "foxglove_msgs/ImageAnnotations", _annotations(boxes, header["stamp"])


def _detection(track: dict[Any, Any], header: dict[str, Any]) -> dict[str, Any]:
    x, y, width, height = track["box"]
    position = {"x": x + width / 2, "y": y + height / 2}
    score = track.get("score")
    hypothesis = {
        "class_id": track.get("class") or track.get("state") or "",
        "score": score if numbers_of((score,)) else 1.0,
    }
    pose = {"pose": {"orientation": {"w": 1.0}}}
    return {
        "header": header,
        "results": [{"hypothesis": hypothesis, "pose": pose}],
        "bbox": {"center": {"position": position}, "size_x": width, "size_y": height},
        "id": track.get("id", ""),
    }


def _annotations(boxes: list[dict[Any, Any]], stamp: dict[str, int]) -> dict[str, Any]:
    points, texts = [], []
    for each in boxes:
        x, y, width, height = each["box"]
        corners = ((x, y), (x + width, y), (x + width, y + height), (x, y + height))
        points.append(
            {
                "timestamp": stamp,
                "type": LINE_LOOP,
                "points": [{"x": right, "y": down} for right, down in corners],
                "outline_color": GREEN,
                "thickness": 2.0,
            }
        )
        texts.append(
            {
                "timestamp": stamp,
                "position": {"x": x, "y": y},
                "text": each.get("id", ""),
                "font_size": 14.0,
                "text_color": WHITE,
                "background_color": {"a": 1.0},
            }
        )
    return {"points": points, "texts": texts}


def _header(header: dict[Any, Any], record: Record) -> dict[str, Any]:
    stamp_ns = header.get("stamp_ns")
    if type(stamp_ns) is not int or not 0 <= stamp_ns < MAX_STAMP_NS:
        stamp_ns = record.log_time_ns
    stamp = {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}
    return {"stamp": stamp, "frame_id": header.get("camera") or ""}
