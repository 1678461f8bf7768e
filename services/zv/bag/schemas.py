"""The schemas of a recording: Foxglove's, with fields added that hold what Zenoh carried beside.

Field numbers and types of Foxglove's messages: https://docs.foxglove.dev/docs/sdk/schemas.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from zv.bag.protobuf import descriptor_set

ENCODING, ATTACHMENT, TIME, CLOCK, KIND, ORIGIN, QOS = range(100, 107)
"""Numbers of the added fields, in every schema of samples."""

ADDED: Final = (
    f"string zenoh_encoding = {ENCODING}, bytes zenoh_attachment = {ATTACHMENT}, "
    f"fixed64 zenoh_time_ntp64 = {TIME}, string zenoh_time_clock = {CLOCK}, "
    f"bool zenoh_deleted = {KIND}, bool zenoh_queried = {ORIGIN}, uint32 zenoh_qos = {QOS}"
)
_STAMP: Final = "google.protobuf.Timestamp timestamp = 1"


@dataclass(frozen=True)
class Schema:
    """One schema of a file.

    Attributes:
        kind: What the messages of its channels are: ``sample.v1``, ``derived.v1``, ``account.v1``.
        message_encoding: MCAP's name of the messages' encoding.
        encoding: MCAP's name of the schema's encoding.
        payload: Number of the field that is the payload of a sample.
    """

    name: str
    kind: str
    message_encoding: str
    encoding: str
    data: bytes
    payload: int = 0


def _protobuf(name: str, kind: str, messages: Mapping[str, str], payload: int = 0) -> Schema:
    stamp = {"google.protobuf.Timestamp": "int64 seconds = 1, int32 nanos = 2"}
    data = descriptor_set({**stamp, **messages})
    return Schema(name, kind, "protobuf", "protobuf", data, payload)


def _sample(name: str, fields: str, *, payload: int) -> Schema:
    return _protobuf(name, "sample.v1", {name: f"{_STAMP}, {fields}, {ADDED}"}, payload)


COMPRESSED_IMAGE: Final = _sample(
    "foxglove.CompressedImage", "string frame_id = 4, bytes data = 2, string format = 3", payload=2
)
RAW_IMAGE: Final = _sample(
    "foxglove.RawImage",
    "string frame_id = 7, fixed32 width = 2, fixed32 height = 3, string encoding = 4, "
    "fixed32 step = 5, bytes data = 6",
    payload=6,
)
SAMPLE: Final = _sample("zenoh_vision.Sample", "bytes payload = 2", payload=2)
ANNOTATIONS: Final = _protobuf(
    "foxglove.ImageAnnotations",
    "derived.v1",
    {
        "foxglove.Color": "double r = 1, double g = 2, double b = 3, double a = 4",
        "foxglove.Point2": "double x = 1, double y = 2",
        "foxglove.CircleAnnotation": (
            f"{_STAMP}, foxglove.Point2 position = 2, double diameter = 3, double thickness = 4, "
            "foxglove.Color fill_color = 5, foxglove.Color outline_color = 6"
        ),
        "foxglove.PointsAnnotation": (
            f"{_STAMP}, Type(UNKNOWN|POINTS|LINE_LOOP|LINE_STRIP|LINE_LIST) type = 2, "
            "repeated foxglove.Point2 points = 3, foxglove.Color outline_color = 4, "
            "repeated foxglove.Color outline_colors = 5, foxglove.Color fill_color = 6, "
            "double thickness = 7"
        ),
        "foxglove.TextAnnotation": (
            f"{_STAMP}, foxglove.Point2 position = 2, string text = 3, double font_size = 4, "
            "foxglove.Color text_color = 5, foxglove.Color background_color = 6"
        ),
        "foxglove.ImageAnnotations": (
            "repeated foxglove.CircleAnnotation circles = 1, "
            "repeated foxglove.PointsAnnotation points = 2, "
            "repeated foxglove.TextAnnotation texts = 3, google.protobuf.Timestamp timestamp = 5"
        ),
    },
)
CALIBRATION: Final = _protobuf(
    "foxglove.CameraCalibration",
    "derived.v1",
    {
        "foxglove.CameraCalibration": (
            f"{_STAMP}, string frame_id = 9, fixed32 width = 2, fixed32 height = 3, "
            "string distortion_model = 4, repeated double D = 5, repeated double K = 6, "
            "repeated double R = 7, repeated double P = 8"
        )
    },
)
ACCOUNT: Final = Schema(
    "zenoh_vision.Account",
    "account.v1",
    "json",
    "jsonschema",
    json.dumps(
        {
            "title": "zenoh_vision.Account",
            "type": "object",
            "properties": {
                "begin_ns": {"type": "integer"},
                "end_ns": {"type": "integer"},
                "keys": {"type": "object"},
                "notes": {"type": "array", "items": {"type": "string"}},
            },
        }
    ).encode(),
)

SAMPLES: Final = {each.name: each for each in (COMPRESSED_IMAGE, RAW_IMAGE, SAMPLE)}
"""The schemas of samples by their names."""

CHANNEL_KIND: Final = "zenoh_vision"
"""Name in a channel's metadata under which it says what its messages are."""
