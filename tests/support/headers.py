"""The header of a frame, for tests that do not care whose it is."""

from __future__ import annotations

from zenoh_vision.messages import Header

NOW_NS = 1_750_000_000_000_000_000


def header(seq: int = 0, epoch: int = 100, **changes: object) -> Header:
    fields = {
        "camera": "front",
        "epoch": epoch,
        "seq": seq,
        "stamp_ns": NOW_NS,
        "width": 64,
        "height": 48,
        "encoding": "bgr8",
    }
    return Header.from_map(fields | changes)
