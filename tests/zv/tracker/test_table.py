"""The table of ``zv track`` has every frame that has arrived."""

from __future__ import annotations

import io
from types import SimpleNamespace
from typing import Any

from zenoh_vision.messages import Header, Tracks
from zv.tracker.table import Arrivals, Table


class Payload:
    """The bytes of a frame's tracks; while they are read, the other thread may run."""

    def __init__(self, seq: int, meanwhile: Any) -> None:
        header = Header(camera="front", epoch=1, seq=seq, stamp_ns=1, width=64, height=48)
        self._bytes = Tracks(header=header, tracks=()).to_bytes()
        self._meanwhile = meanwhile

    def to_bytes(self) -> bytes:
        self._meanwhile()
        return self._bytes


def test_a_frame_that_arrives_while_others_are_written_is_not_lost():
    session: Any = SimpleNamespace(declare_subscriber=lambda _key, _handler: None)
    arrived, table = Arrivals(session, "front"), Table(io.StringIO(), mot=False)
    for seq in range(3):
        sample: Any = SimpleNamespace(payload=Payload(seq, lambda: arrived.pass_on(table)))
        arrived._note(sample)
    arrived.pass_on(table)
    assert (table.frames, table.newest) == (3, (1, 2))
