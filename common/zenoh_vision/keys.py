"""Key expressions and Zenoh encodings.

A ROS user reads ``vision/front/image/compressed`` as the topic ``/vision/front/image/compressed``.
Chunks that start with ``@`` are not matched by ``*`` or ``**``, so ``vision/front/**`` is a
camera's data and nothing else.
"""

from __future__ import annotations

import re
from typing import Final, Literal

DEFAULT_NAMESPACE: Final = "vision"
DEFAULT_CAMERA: Final = "front"
NAME: Final = re.compile(r"[a-z0-9_]+")

JPEG: Final = "image/jpeg"
PNG: Final = "image/png"
RAW_IMAGE: Final = "application/octet-stream;vision.Image.v1"
BITS: Final = "application/octet-stream;vision.Bits.v1"
UNCOMPRESSED: Final = {RAW_IMAGE: "raw", BITS: "bits"}
"""Encodings of pictures without a size of their own, which only their header says, with the word
for each."""
JSON: Final = "application/json"

Way = Literal["shm", "jpeg", "raw"]
"""How a frame came: through shared memory, or over Zenoh, compressed (JPEG or PNG) or raw."""

Transport = Literal["auto", "shm", "raw", "jpeg"]
"""Which way a consumer takes a camera's frames. ``jpeg``: the key of the compressed frames, JPEG or
PNG. ``raw``: that of the raw pixels. ``shm``: shared memory. ``auto``: shared memory if camera and
consumer have it in common, else the compressed frames if they flow, else the raw ones."""

TRANSPORT_VARIABLE: Final = "ZV_TRANSPORT"
"""Environment variable: the transport of every consumer without a setting of its own. A camera
offers shared memory if it is ``auto`` or ``shm``."""


def msgpack_of(schema_name: str) -> str:
    """Return the Zenoh encoding of a msgpack message, such as ``vision.Centroid.v1``."""
    return f"application/msgpack;{schema_name}"


def schema_name_of(encoding: str) -> str:
    """Return the schema name in a Zenoh encoding; empty if there is none."""
    return encoding.partition(";")[2]


def short_name_of(schema_name: str) -> str:
    """Return ``Centroid`` of the schema name ``vision.Centroid.v1``."""
    chunks = schema_name.split(".")
    return chunks[-2] if len(chunks) > 1 else schema_name


def type_of(encoding: str) -> str:
    """Return the type of a Zenoh encoding in one word: ``Centroid``, ``JPEG``, or else ``-``."""
    if schema_name := schema_name_of(encoding):
        return short_name_of(schema_name)
    kind, _, form = encoding.partition("/")
    return form.upper() if kind == "image" else "-"


def is_name(text: str) -> bool:
    """Tell whether a text may be a namespace, camera or node name."""
    return NAME.fullmatch(text) is not None


def camera_of(key: str) -> str:
    """Return the camera in ``{namespace}/{camera}/{suffix}``; empty if there is none."""
    chunks = key.split("/", 2)
    return chunks[1] if len(chunks) == 3 else ""


def suffix_of(key: str) -> str:
    """Return what follows the camera in ``{namespace}/{camera}/{suffix}``; empty if nothing."""
    return key.partition("/")[2].partition("/")[2]


def node_key(namespace: str, node: str) -> str:
    """Return the key of a node's liveliness token and description."""
    return f"@{namespace}/node/{node}"


def diagnostics_key(namespace: str, node: str) -> str:
    """Return the key of a node's health."""
    return f"@{namespace}/diagnostics/{node}"


def shared_memory_key(namespace: str, camera: str, machine: str, offer: str) -> str:
    """Return the key of a camera's offer of its frames in shared memory; each may be ``*``."""
    return f"@{namespace}/shm/{camera}/{machine}/{offer}"


def parameter_key(namespace: str, node: str, name: str) -> str:
    """Return the key of a node's parameter; ``node`` and ``name`` may be ``*``."""
    return f"@{namespace}/param/{node}/{name}"


def parameters_key(namespace: str, node: str) -> str:
    """Return the key of all parameters of a node; ``node`` may be ``*``."""
    return f"@{namespace}/param/{node}"


def schema_key(namespace: str, name: str) -> str:
    """Return the key of a message's JSON Schema; ``name`` may be ``*``."""
    return f"@{namespace}/schema/{name}"
