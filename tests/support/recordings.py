"""Small recordings, made by the test itself."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import msgpack

from tests.support.pictures.encoded import HEIGHT, WIDTH, jpeg, scene
from zv.bag.record import Record
from zv.bag.writer import Writer

BEGIN_NS = 1_750_000_000_000_000_000
"""Some day of 2025: hours before any test."""


def frame_header(seq: int, rate_hz: float = 30.0, **changes: object) -> dict[str, object]:
    return {
        "camera": "front",
        "epoch": BEGIN_NS,
        "seq": seq,
        "stamp_ns": BEGIN_NS + round(seq * 1e9 / rate_hz),
        "width": WIDTH,
        "height": HEIGHT,
        "encoding": "bgr8",
        "node": "camera_front",
        "revision": 0,
    } | changes


def frames(count: int, rate_hz: float = 30.0, still: int = 0, **changes: object) -> list[Record]:
    """Return the frames of a camera that sees a square move, after some without it."""
    found = []
    for seq in range(count):
        header = frame_header(seq, rate_hz, **changes)
        found.append(
            Record(
                f"vision/{header['camera']}/image/compressed",
                jpeg(scene(None if seq < still else seq - still)),
                "image/jpeg",
                msgpack.packb(header),
                log_time_ns=int(str(header["stamp_ns"])) + 3_000_000,
            )
        )
    return found


def centroids(of: Iterable[Record], **fields: object) -> list[Record]:
    """Return a centroid for each frame, 5 ms after it."""
    found = []
    for frame in of:
        header = {**frame.header, "node": "tracker_front"}
        del header["encoding"]
        values = {"x": 1, "y": 2, "box": None, "area": None} | fields
        found.append(
            Record(
                frame.key.replace("image/compressed", "centroid"),
                msgpack.packb({"header": header, **values}),
                "application/msgpack;vision.Centroid.v1",
                msgpack.packb(header),
                log_time_ns=frame.log_time_ns + 5_000_000,
            )
        )
    return found


def write(path: Path, *parts: Iterable[Record]) -> Path:
    """Write records in the order of their arrival."""
    writer = Writer(path, {"namespace": "vision"})
    for record in sorted(
        (each for part in parts for each in part), key=lambda one: one.log_time_ns
    ):
        writer.add(record)
    writer.close()
    return path
