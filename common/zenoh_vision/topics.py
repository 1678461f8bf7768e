"""The topic table: the message of every stream, and how it is delivered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from zenoh_vision import keys
from zenoh_vision.keys import JPEG, PNG, RAW_IMAGE, msgpack_of
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import (
    CameraInfo,
    Centroid,
    Contours,
    Prediction,
    TrackEvent,
    Tracks,
)

Delivery = Literal["frame", "message"]
"""``frame``: BLOCK_FIRST at data priority, so that a slow link carries whole frames or none.
``message``: BLOCK at INTERACTIVE_HIGH, since it is small and must arrive; it overtakes frames."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the table.

    Attributes:
        name: The part of its key after ``{namespace}/{camera}/``: ``image/compressed``.
        encoding: Zenoh encoding of the payload.
        message: Class of its messages; None for pictures.
        delivery: Priority and congestion control.
        lazy: Payloads are made only for subscribers and queries.
        keeps: How many of its newest payloads answer a query.
        by_query: It is never published: a function of the node answers each query.
    """

    name: str
    encoding: str
    message: type[Message] | None = None
    delivery: Delivery = "frame"
    lazy: bool = True
    keeps: int = 1
    by_query: bool = False

    def key(self, namespace: str, camera: str) -> str:
        """Return the full key expression; the camera may be ``*``."""
        return f"{namespace}/{camera}/{self.name}"

    @property
    def raw(self) -> bool:
        """Whether its payloads are raw pixels."""
        return self.encoding == RAW_IMAGE


def message_topic(name: str, message: type[Message], *, keeps: int = 1) -> Topic:
    """Return the topic of a msgpack message, which is published even without subscribers."""
    encoding = msgpack_of(message.schema_name)
    return Topic(name, encoding, message, delivery="message", lazy=False, keeps=keeps)


COMPRESSED = Topic("image/compressed", JPEG)
RAW = Topic("image", RAW_IMAGE)
CENTROID = message_topic("centroid", Centroid)
TRACKS = message_topic("tracks", Tracks)
EVENTS = message_topic("events", TrackEvent, keeps=100)
PREDICTION = Topic(
    "prediction", msgpack_of(Prediction.schema_name), Prediction, delivery="message", by_query=True
)
EDGES = Topic("edges/compressed", PNG)
CONTOURS = Topic("edges/contours", msgpack_of(Contours.schema_name), Contours, lazy=True)
EDGE_STAGES: Final = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")

TOPICS: Final = {
    topic.name: topic
    for topic in (
        COMPRESSED,
        RAW,
        message_topic("camera_info", CameraInfo),
        CENTROID,
        TRACKS,
        EVENTS,
        PREDICTION,
        Topic("tracked/compressed", JPEG),
        Topic("mask/compressed", PNG),
        Topic("background/compressed", JPEG),
        EDGES,
        *(Topic(f"edges/{stage}/compressed", PNG) for stage in EDGE_STAGES),
        CONTOURS,
        message_topic("truth", Tracks),
    )
}


def topic_named(topic: Topic | str) -> Topic:
    """Return the topic itself, or the one of this name in the table.

    Raises:
        ValueError: The table has no topic of this name.
    """
    if isinstance(topic, Topic):
        return topic
    if topic not in TOPICS:
        raise ValueError(f"no topic {topic!r}; known are {', '.join(TOPICS)}")
    return TOPICS[topic]


def topic_of(key: str) -> Topic | None:
    """Return the topic that a key belongs to, whatever its namespace and camera."""
    return TOPICS.get(keys.suffix_of(key))
