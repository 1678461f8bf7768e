"""Headers of frames that arrive at an admission."""

from __future__ import annotations

from common.admission import Admission
from common.messages import Header

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


def seen(admission: Admission, found: Header, at_s: float = 0.0) -> Header:
    admission.admit(found, at_s)
    admission.accept(found, at_s)
    return found
