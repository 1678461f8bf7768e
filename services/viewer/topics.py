"""Topics as people write them, and the keys that they mean."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from common import keys

COMPRESSED = "/compressed"
CHUNK = re.compile(r"[A-Za-z0-9_.~-]+")
MAX_CHARACTERS = 200
BY_SUFFIX = {topic.suffix: topic for topic in keys.TOPICS.values()}


@dataclass(frozen=True, slots=True)
class Kind:
    """What travels on a key.

    Attributes:
        picture: Whether it is pictures; else messages.
        type: ``image/jpeg``, ``image/png``, or the name of a message; empty if not known.
        raw: The pictures are raw pixels.
    """

    picture: bool
    type: str
    raw: bool = False


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


def camera_of(key: str) -> str:
    """Return the camera in a stream's key."""
    return key.split("/")[1]


def suffix_of(key: str) -> str:
    """Return what stands behind the camera: ``image/compressed``."""
    return key.split("/", 2)[2]


def kind_of(key: str) -> Kind:
    """Return what travels on a key, by the topic table; by its end if it is not in there."""
    suffix = suffix_of(key)
    topic = BY_SUFFIX.get(suffix)
    if topic is None:
        return Kind(picture=suffix.endswith(COMPRESSED), type="")
    raw = topic.encoding == keys.RAW_IMAGE
    if raw or topic.encoding.startswith("image/"):
        return Kind(picture=True, type=keys.JPEG if raw else topic.encoding, raw=raw)
    return Kind(picture=False, type=topic.encoding.partition(";")[2])


def candidates(text: str, namespace: str, *, raw: bool = False) -> list[str]:
    """Return the keys that a topic may mean, the likeliest first; none if it can mean none.

    ``/front/image/compressed`` and ``vision/front/image/compressed`` are one stream, and
    ``/front/image`` its uncompressed twin: in ROS one names that and gets the other.

    Args:
        text: As given in a URL.
        namespace: First chunk of the keys.
        raw: A topic that is both is meant as raw pixels.
    """
    bare = text.removeprefix("/")
    found = []
    for key in (bare, f"{namespace}/{bare}"):
        twin = [] if key.endswith(COMPRESSED) else [f"{key}{COMPRESSED}"]
        found += [key, *twin] if raw else [*twin, key]
    return [key for key in found if is_stream(key, namespace)]


def meant(text: str, namespace: str, known: Collection[str], *, raw: bool = False) -> str | None:
    """Return the key that a topic means: one that is known, else the likeliest.

    Args:
        text: As given in a URL.
        namespace: First chunk of the keys.
        known: The keys of the streams that there are.
        raw: As for ``candidates``.

    Returns:
        None if the text can be no stream's name.
    """
    possible = [key for key in candidates(text, namespace, raw=raw) if kind_of(key).picture]
    return next((key for key in possible if key in known), possible[0] if possible else None)
