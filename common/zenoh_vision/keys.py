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
SCHEMA_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")

JPEG: Final = "image/jpeg"
PNG: Final = "image/png"
RAW_IMAGE: Final = "application/octet-stream;vision.Image.v1"
BITS: Final = "application/octet-stream;vision.Bits.v1"
UNCOMPRESSED: Final = {RAW_IMAGE: "raw", BITS: "bits"}
"""Encodings of pictures without a size of their own, which only their header says, with the word
for each; here for programs that list samples without loading OpenCV."""
JSON: Final = "application/json"

RouteName = Literal["shm", "jpeg", "raw"]
"""How frames come: through shared memory, or over Zenoh on the key of the compressed frames (JPEG
or PNG) or on that of the raw pixels."""

Transport = Literal["auto", "shm", "raw", "jpeg"]
"""The route that a consumer chooses for a camera's frames. ``auto``: shared memory if camera and
consumer have it in common, else the compressed frames if they flow, else the raw ones."""

LaunchVerb = Literal["stop", "start", "restart"]
"""What ``zv up`` does with a node that it runs, on request."""

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


def is_picture(encoding: str) -> bool:
    """Tell whether samples of a Zenoh encoding are pictures, compressed or raw."""
    return encoding.startswith("image/") or encoding in UNCOMPRESSED


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


LINK: Final = "@link"
"""Key that nobody declares a token on; a router that answers a query for its tokens works."""


def holder_key(name: str) -> str:
    """Return the key on which the holder of a certificate shows that it is connected.

    No namespace has a dash, and routers do not list keys with ``@``.
    """
    return f"zenoh-vision/holder/{name}"


def granted_key(name: str, session: str, kind: str, key: str) -> str:
    """Return the key of the token that shows a holder that it may declare something.

    Args:
        name: The holder's.
        session: Id of its session, or ``*``.
        kind: ``subscriber`` or ``queryable``.
        key: Key expression of what is declared; without ``@``.
    """
    return f"{holder_key(name)}/{session}/{kind}/{key}"


def node_key(namespace: str, node: str) -> str:
    """Return the key of a node's liveliness token and description."""
    return f"@{namespace}/node/{node}"


def diagnostics_key(namespace: str, node: str) -> str:
    """Return the key of a node's health."""
    return f"@{namespace}/diagnostics/{node}"


def launch_key(namespace: str, node: str) -> str:
    """Return the key on which the ``zv up`` that runs a node answers for it; may be ``*``."""
    return f"@{namespace}/launch/{node}"


def shared_memory_key(namespace: str, camera: str, machine: str, offer: str) -> str:
    """Return the key of a camera's offer of its frames in shared memory; each may be ``*``."""
    return f"@{namespace}/shm/{camera}/{machine}/{offer}"


def parameter_key(namespace: str, node: str, name: str) -> str:
    """Return the key of a node's parameter; ``node`` and ``name`` may be ``*``."""
    return f"@{namespace}/param/{node}/{name}"


def parameters_key(namespace: str, node: str) -> str:
    """Return the key of all parameters of a node; ``node`` may be ``*``."""
    return f"@{namespace}/param/{node}"


def set_key(namespace: str, node: str) -> str:
    """Return the key that sets parameters of a node; ``node`` may be ``*``."""
    return f"@{namespace}/set/{node}"


def record_key(namespace: str, node: str) -> str:
    """Return the key on which a query has a recorder write its last seconds; it may be ``*``."""
    return f"@{namespace}/record/{node}"


def schema_key(namespace: str, name: str) -> str:
    """Return the key of a message's JSON Schema; ``name`` may be ``*``."""
    return f"@{namespace}/schema/{name}"
