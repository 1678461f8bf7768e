"""The schemas of a recording: Foxglove's, with fields added that hold what Zenoh carried beside.

Field numbers and types of Foxglove's messages: https://docs.foxglove.dev/docs/sdk/schemas.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Final

from zv.bag.protobuf import Field, Messages, descriptor_set

ENCODING, ATTACHMENT, TIME, CLOCK, KIND, ORIGIN, QOS = range(100, 107)
"""Numbers of the added fields, in every schema of samples."""

ADDED: Final = (
    Field("zenoh_encoding", ENCODING, "string"),
    Field("zenoh_attachment", ATTACHMENT, "bytes"),
    Field("zenoh_time_ntp64", TIME, "fixed64"),
    Field("zenoh_time_clock", CLOCK, "string"),
    Field("zenoh_deleted", KIND, "bool"),
    Field("zenoh_queried", ORIGIN, "bool"),
    Field("zenoh_qos", QOS, "uint32"),
)

_TIMESTAMP: Final[Messages] = {
    "google.protobuf.Timestamp": (
        Field("seconds", 1, "int64"),
        Field("nanos", 2, "int32"),
    )
}
_STAMP = Field("timestamp", 1, "google.protobuf.Timestamp")


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


def _protobuf(name: str, kind: str, messages: Messages, payload: int = 0) -> Schema:
    data = descriptor_set({**_TIMESTAMP, **messages})
    return Schema(name, kind, "protobuf", "protobuf", data, payload)


def _sample(name: str, *fields: Field, payload: int) -> Schema:
    return _protobuf(name, "sample.v1", {name: (_STAMP, *fields, *ADDED)}, payload)


COMPRESSED_IMAGE: Final = _sample(
    "foxglove.CompressedImage",
    Field("frame_id", 4, "string"),
    Field("data", 2, "bytes"),
    Field("format", 3, "string"),
    payload=2,
)
RAW_IMAGE: Final = _sample(
    "foxglove.RawImage",
    Field("frame_id", 7, "string"),
    Field("width", 2, "fixed32"),
    Field("height", 3, "fixed32"),
    Field("encoding", 4, "string"),
    Field("step", 5, "fixed32"),
    Field("data", 6, "bytes"),
    payload=6,
)
SAMPLE: Final = _sample("zenoh_vision.Sample", Field("payload", 2, "bytes"), payload=2)
ANNOTATIONS: Final = _protobuf(
    "foxglove.ImageAnnotations",
    "derived.v1",
    {
        "foxglove.Color": tuple(
            Field(name, number, "double") for number, name in enumerate("rgba", 1)
        ),
        "foxglove.Point2": (Field("x", 1, "double"), Field("y", 2, "double")),
        "foxglove.CircleAnnotation": (
            _STAMP,
            Field("position", 2, "foxglove.Point2"),
            Field("diameter", 3, "double"),
            Field("thickness", 4, "double"),
            Field("fill_color", 5, "foxglove.Color"),
            Field("outline_color", 6, "foxglove.Color"),
        ),
        "foxglove.PointsAnnotation": (
            _STAMP,
            Field(
                "type",
                2,
                "Type",
                choices=("UNKNOWN", "POINTS", "LINE_LOOP", "LINE_STRIP", "LINE_LIST"),
            ),
            Field("points", 3, "foxglove.Point2", repeated=True),
            Field("outline_color", 4, "foxglove.Color"),
            Field("outline_colors", 5, "foxglove.Color", repeated=True),
            Field("fill_color", 6, "foxglove.Color"),
            Field("thickness", 7, "double"),
        ),
        "foxglove.TextAnnotation": (
            _STAMP,
            Field("position", 2, "foxglove.Point2"),
            Field("text", 3, "string"),
            Field("font_size", 4, "double"),
            Field("text_color", 5, "foxglove.Color"),
            Field("background_color", 6, "foxglove.Color"),
        ),
        "foxglove.ImageAnnotations": (
            Field("circles", 1, "foxglove.CircleAnnotation", repeated=True),
            Field("points", 2, "foxglove.PointsAnnotation", repeated=True),
            Field("texts", 3, "foxglove.TextAnnotation", repeated=True),
            Field("timestamp", 5, "google.protobuf.Timestamp"),
        ),
    },
)
CALIBRATION: Final = _protobuf(
    "foxglove.CameraCalibration",
    "derived.v1",
    {
        "foxglove.CameraCalibration": (
            _STAMP,
            Field("frame_id", 9, "string"),
            Field("width", 2, "fixed32"),
            Field("height", 3, "fixed32"),
            Field("distortion_model", 4, "string"),
            *(Field(name, n, "double", repeated=True) for n, name in enumerate("DKRP", 5)),
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
