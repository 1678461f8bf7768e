"""What a broken or hostile client sends: the malformed payloads, on every key of a system."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from typing import Any

import msgpack

from tests.support.pictures.encoded import PICTURES, size_of

JPEG = PICTURES[0]
PNG_START = b"\x89PNG\r\n\x1a\n"
NAME = "rogue"

SUFFIXES = (
    "image/compressed", "image", "camera_info", "centroid", "tracks", "events",
    "tracked/compressed", "mask/compressed", "background/compressed", "edges/compressed",
    "edges/smoothed/compressed", "truth",
)  # fmt: skip
NODES = ("camera_front", "tracker_front", "edge_front")


def keys() -> list[str]:
    """Return every key of a system with one camera, and those of its nodes."""
    own = [f"vision/front/{suffix}" for suffix in SUFFIXES]
    for node in NODES:
        own += [
            f"@vision/node/{node}",
            f"@vision/diagnostics/{node}",
            f"@vision/param/{node}",
            f"@vision/param/{node}/quality",
            f"@vision/set/{node}",
            f"@vision/set/{node}/quality",
        ]
    return [*own, "@vision/schema/Centroid", "@vision/diagnostics/nobody", "vision/other/image"]


def header(**changes: Any) -> bytes:
    """Return a header that is right but for what is changed."""
    width, height = size_of(JPEG)
    right = {
        "camera": "front", "epoch": time.time_ns(), "seq": 1, "stamp_ns": time.time_ns(),
        "width": width, "height": height, "encoding": "bgr8", "node": NAME, "revision": 0,
    }  # fmt: skip
    packed: bytes = msgpack.packb(right | changes)
    return packed


def malformed() -> Iterator[tuple[bytes, bytes | None]]:
    """Yield payload and attachment, one kind of wrong after the other, without end."""
    lying = JPEG.index(b"\xff\xc0") + 5
    huge = JPEG[:lying] + struct.pack(">HH", 65000, 65000) + JPEG[lying + 4 :]
    fixed: list[tuple[bytes, bytes | None]] = [
        (b"", None),
        (b"hello", None),
        (b"GIF89a" + bytes(100), None),
        (PNG_START, None),
        (PNG_START + bytes(1000), header()),
        (JPEG[: len(JPEG) // 2], None),
        (JPEG[:2], None),
        (huge, None),
        (JPEG, b""),
        (JPEG, b"\xc1"),
        (JPEG, b"no map"),
        (JPEG, bytes(5000)),
        (JPEG, msgpack.packb([1, 2, 3])),
        (JPEG, msgpack.packb({"camera": "front"})),
        (msgpack.packb({}), None),
        (msgpack.packb({"header": None, "x": "nan"}), None),
        (b"\xdc\xff\xff" * 10, None),
        (bytes([0x91]) * 5000, None),
        (msgpack.packb({"node": "camera_front", "level": 99}), None),
    ]
    wrong: dict[str, tuple[object, ...]] = {
        "camera": ("back", 7),
        "seq": (-1, "x", 1.5),
        "epoch": (0, None),
        "stamp_ns": (-5,),
        "width": (0, 1),
        "height": (10**9,),
        "encoding": ("bayer", 3),
    }
    while True:
        yield from fixed
        yield from ((JPEG, header(**{name: each})) for name in wrong for each in wrong[name])
        yield JPEG, header(stamp_ns=time.time_ns() + 10**15)  # eleven days ahead
        yield JPEG[:-200], header(epoch=time.time_ns())  # a newer epoch, with a broken picture
