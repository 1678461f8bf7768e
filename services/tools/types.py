"""The message types by name, and which topic of the table a key expression belongs to."""

from __future__ import annotations

from typing import Final

from common.codec import Message
from common.errors import ConfigurationError
from common.keys import TOPICS, Topic
from common.messages import (
    CameraInfo,
    Centroid,
    Diagnostics,
    Header,
    NodeDescription,
    Parameter,
    ParameterList,
    Refusal,
    TrackEvent,
    Tracks,
)
from common.near_names import nearest, question

MESSAGES: Final[dict[str, type[Message]]] = {
    message.schema_name: message
    for message in (
        Header,
        Centroid,
        Tracks,
        TrackEvent,
        CameraInfo,
        Diagnostics,
        Parameter,
        ParameterList,
        Refusal,
        NodeDescription,
    )
}


def short_name(schema_name: str) -> str:
    """Return ``Centroid`` for ``vision.Centroid.v1``."""
    chunks = schema_name.split(".")
    return chunks[-2] if len(chunks) > 1 else schema_name


def schema_of(encoding: str) -> str:
    """Return the schema name in a Zenoh encoding; empty if there is none."""
    return encoding.partition(";")[2]


def type_of(encoding: str) -> str:
    """Return in one word what a Zenoh encoding carries."""
    schema = schema_of(encoding)
    if schema:
        return short_name(schema)
    kind, _, form = encoding.partition("/")
    return form.upper() if kind == "image" else "-"


def message_named(name: str) -> type[Message]:
    """Return a message's class by its short or versioned name, in any case.

    Raises:
        ConfigurationError: There is none; says which there are.
    """
    known = {short_name(schema): message for schema, message in MESSAGES.items()}
    for spelling, message in [*known.items(), *MESSAGES.items()]:
        if name.lower() == spelling.lower():
            return message
    hint = question(nearest(name, known), after=" ")
    raise ConfigurationError(f"no message {name!r}: {hint}there are {', '.join(sorted(known))}")


def topic_of(key: str) -> Topic | None:
    """Return the row of the topic table that a key belongs to, whatever its namespace."""
    _, _, suffix = key.partition("/")[2].partition("/")
    return next((topic for topic in TOPICS.values() if topic.suffix == suffix), None)


def camera_of(key: str) -> str:
    """Return the camera in a key of the table."""
    return key.split("/")[1]
