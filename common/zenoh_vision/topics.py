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
    Replay,
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
        recent: Of how many frames the payload answers a query that names the frame.
        by_query: It is never published: a function of the node answers each query.
        recorded: Part of a recording unless keys are named; not what is made for display only, nor
            a second form of what is recorded.
        every_frame: There is one payload for each frame that the node processes, so a number that
            is missing on it is a loss.
    """

    name: str
    encoding: str
    message: type[Message] | None = None
    delivery: Delivery = "frame"
    lazy: bool = True
    keeps: int = 1
    recent: int = 0
    by_query: bool = False
    recorded: bool = True
    every_frame: bool = True

    def key(self, namespace: str, camera: str) -> str:
        """Return the full key expression; the camera may be ``*``."""
        return f"{namespace}/{camera}/{self.name}"


def message_topic(
    name: str,
    message: type[Message],
    *,
    keeps: int = 1,
    recent: int = 0,
    every_frame: bool = True,
) -> Topic:
    """Return the topic of a msgpack message, which is published even without subscribers."""
    return Topic(
        name,
        msgpack_of(message.schema_name),
        message,
        delivery="message",
        lazy=False,
        keeps=keeps,
        recent=recent,
        every_frame=every_frame,
    )


COMPRESSED = Topic("image/compressed", JPEG, recent=10)
RAW = Topic("image", RAW_IMAGE, recorded=False)
CENTROID = message_topic("centroid", Centroid)
TRACKS = message_topic("tracks", Tracks, recent=100)
EVENTS = message_topic("events", TrackEvent, keeps=100, every_frame=False)
PREDICTION = Topic(
    "prediction",
    msgpack_of(Prediction.schema_name),
    Prediction,
    delivery="message",
    by_query=True,
    recorded=False,
)
REPLAY = message_topic("replay", Replay)
EDGES = Topic("edges/compressed", PNG)
CONTOURS = Topic("edges/contours", msgpack_of(Contours.schema_name), Contours, lazy=True)
EDGE_STAGES: Final = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")

TOPICS: Final = {
    topic.name: topic
    for topic in (
        COMPRESSED,
        RAW,
        message_topic("camera_info", CameraInfo, every_frame=False),
        CENTROID,
        TRACKS,
        EVENTS,
        PREDICTION,
        Topic("tracked/compressed", JPEG, recorded=False),
        Topic("mask/compressed", PNG, recorded=False),
        Topic("background/compressed", JPEG, recorded=False),
        Topic("relayed/compressed", JPEG, recorded=False),
        EDGES,
        *(Topic(f"edges/{stage}/compressed", PNG, recorded=False) for stage in EDGE_STAGES),
        CONTOURS,
        message_topic("truth", Tracks),
        REPLAY,
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


def is_frame_key(key: str) -> bool:
    """Tell whether the samples on a key are frames of a camera."""
    return keys.suffix_of(key) in (COMPRESSED.name, RAW.name) and not key.startswith("@")


def misnamed_camera(key: str, namespace: str) -> str:
    """Return the camera of a stream of frames whose name is none, such as ``cam-1``; else empty.

    Another program may publish on any key.
    """
    camera = keys.camera_of(key)
    if not is_frame_key(key) or not key.startswith(f"{namespace}/"):
        return ""
    return "" if "*" in camera or keys.is_name(camera) else camera
