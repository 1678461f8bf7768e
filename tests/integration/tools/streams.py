"""Streams whose every message is known, put by plain Zenoh."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import msgpack
import zenoh

JPEG = "image/jpeg"
CENTROID = "application/msgpack;vision.Centroid.v1"


def header(seq: int, **changes: Any) -> dict[str, Any]:
    return {
        "camera": "c",
        "epoch": 1_000,
        "seq": seq,
        "stamp_ns": time.time_ns(),
        "width": 64,
        "height": 48,
        "node": "camera_c",
        **changes,
    }


def put_picture(session: zenoh.Session, key: str, seq: int, **changes: Any) -> None:
    attachment = msgpack.packb(header(seq, encoding="bgr8", **changes))
    session.put(key, b"\xff\xd8\xff" + b"x" * 997, encoding=JPEG, attachment=attachment)


def put_centroid(session: zenoh.Session, key: str, seq: int, **changes: Any) -> None:
    head = header(seq, node="tracker_c", **changes)
    body = {"header": head, "x": seq * 10, "y": 2, "box": [1, 2, 3, 4], "area": 0.5}
    payload, attachment = msgpack.packb(body), msgpack.packb(head)
    session.put(key, payload, encoding=CENTROID, attachment=attachment)


def counting(session: zenoh.Session, key: str, put: Callable = put_picture) -> Callable[[], None]:
    """Return what puts message after message on a key."""
    numbers = iter(range(10**9))
    return lambda: put(session, key, next(numbers))
