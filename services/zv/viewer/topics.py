"""Keys of streams, the kind of their data, and the topics that people write in URLs."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from zenoh_vision import keys
from zenoh_vision.topics import topic_of

COMPRESSED = "/compressed"
CHUNK = re.compile(r"[A-Za-z0-9_.~-]+")
MAX_CHARACTERS = 200


@dataclass(frozen=True, slots=True)
class Kind:
    """The kind of data on a key: pictures or messages."""

    picture: bool
    type: str  # Zenoh encoding of pictures, or the schema name of a message; empty if unknown


def is_stream(key: str, namespace: str) -> bool:
    """Tell whether a key may carry a stream: ``{namespace}/{camera}/...``, without wildcards."""
    chunks = key.split("/")
    return (
        len(key) <= MAX_CHARACTERS
        and len(chunks) >= 3
        and chunks[0] == namespace
        and keys.is_name(chunks[1])
        and all(CHUNK.fullmatch(chunk) for chunk in chunks)
    )


def kind_of(key: str) -> Kind:
    """Return the kind of data on a key, by the topic table, else by the end of the key."""
    topic = topic_of(key)
    if topic is None:
        return Kind(picture=keys.suffix_of(key).endswith(COMPRESSED), type="")
    if topic.message is not None:
        return Kind(picture=False, type=topic.message.schema_name)
    return Kind(picture=True, type=topic.encoding)


def resolve(text: str, namespace: str, known: Collection[str], *, raw: bool = False) -> str | None:
    """Return the key of the pictures that a topic means: a known one, else the most likely one.

    ``/front/image/compressed`` and ``vision/front/image/compressed`` name the same stream. As in
    ROS, ``/front/image`` names its uncompressed version and also means the compressed stream,
    unless ``raw`` prefers the raw pixels. None if the text is not a valid name of a picture stream,
    or the name of a stream of messages.
    """
    bare = text.removeprefix("/")
    named = bare, f"{namespace}/{bare}"
    possible = []
    for key in named:
        twin = [] if key.endswith(COMPRESSED) else [f"{key}{COMPRESSED}"]
        possible += [key, *twin] if raw else [*twin, key]
    possible = [key for key in possible if is_stream(key, namespace) and kind_of(key).picture]
    found = next((key for key in possible if key in known), None)
    if found is None and any(key in known and not kind_of(key).picture for key in named):
        return None
    return found or next(iter(possible), None)
