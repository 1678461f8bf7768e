"""The topic table: every key expression, what travels on it, and how.

A ROS user reads ``vision/front/image/compressed`` as the topic ``/vision/front/image/compressed``.
Chunks that start with ``@`` are not matched by ``*`` or ``**``, so ``vision/front/**`` is a
camera's data and nothing else.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

DEFAULT_NAMESPACE: Final = "vision"
DEFAULT_CAMERA: Final = "front"
NAME: Final = re.compile(r"[a-z0-9_]+")

JPEG: Final = "image/jpeg"
PNG: Final = "image/png"
RAW_IMAGE: Final = "application/octet-stream;vision.Image.v1"
JSON: Final = "application/json"

Delivery = Literal["frame", "message"]
"""``frame``: BLOCK_FIRST at data priority, so that a slow link carries whole frames or none.
``message``: small, must arrive, so INTERACTIVE_HIGH and BLOCK: it overtakes frames."""


def msgpack_of(schema_name: str) -> str:
    """Return the Zenoh encoding of a msgpack message, such as ``vision.Centroid.v1``."""
    return f"application/msgpack;{schema_name}"


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the table.

    Attributes:
        name: What services call it.
        suffix: The key expression behind ``{namespace}/{camera}/``.
        encoding: Zenoh encoding of the payload.
        delivery: How it competes for a link.
        lazy: Made only while someone subscribes, or asks for its newest.
    """

    name: str
    suffix: str
    encoding: str
    delivery: Delivery = "frame"
    lazy: bool = True

    def key(self, namespace: str, camera: str) -> str:
        """Return the full key expression."""
        return f"{namespace}/{camera}/{self.suffix}"


def message_topic(name: str, schema_name: str) -> Topic:
    """Return the row of a msgpack message that is published whether or not anyone listens."""
    return Topic(name, name, msgpack_of(schema_name), delivery="message", lazy=False)


IMAGE = Topic("image", "image/compressed", JPEG)
RAW = Topic("raw", "image", RAW_IMAGE)
TRACKED = Topic("tracked", "tracked/compressed", JPEG)
MASK = Topic("mask", "mask/compressed", PNG)
EDGES = Topic("edges", "edges/compressed", PNG)
BACKGROUND = Topic("background", "background/compressed", JPEG)
CENTROID = message_topic("centroid", "vision.Centroid.v1")
TRACKS = message_topic("tracks", "vision.Tracks.v1")
TRUTH = message_topic("truth", "vision.Tracks.v1")
EVENTS = message_topic("events", "vision.TrackEvent.v1")
CAMERA_INFO = message_topic("camera_info", "vision.CameraInfo.v1")

EDGE_STAGES: Final = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")
STAGES = tuple(Topic(stage, f"edges/{stage}/compressed", PNG) for stage in EDGE_STAGES)

TOPICS: Final = {
    topic.name: topic
    for topic in (
        IMAGE,
        RAW,
        CAMERA_INFO,
        CENTROID,
        TRACKS,
        EVENTS,
        TRACKED,
        MASK,
        BACKGROUND,
        EDGES,
        *STAGES,
        TRUTH,
    )
}


def node_key(namespace: str, node: str) -> str:
    """Return the key of a node's liveliness token and description."""
    return f"@{namespace}/node/{node}"


def diagnostics_key(namespace: str, node: str) -> str:
    """Return the key of a node's health."""
    return f"@{namespace}/diagnostics/{node}"


def parameter_key(namespace: str, node: str, name: str) -> str:
    """Return the key of a node's parameter; ``node`` and ``name`` may be ``*``."""
    return f"@{namespace}/param/{node}/{name}"


def parameters_key(namespace: str, node: str) -> str:
    """Return the key of all parameters of a node; ``node`` may be ``*``."""
    return f"@{namespace}/param/{node}"


def schema_key(namespace: str, name: str) -> str:
    """Return the key of a message's JSON Schema; ``name`` may be ``*``."""
    return f"@{namespace}/schema/{name}"


def is_name(text: str) -> bool:
    """Tell whether a text may stand as a namespace, camera or node name."""
    return NAME.fullmatch(text) is not None
