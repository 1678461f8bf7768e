"""Samples of Zenoh as records, and the clock by which they arrive."""

from __future__ import annotations

import time
from typing import SupportsInt, cast

import zenoh

from zv.bag.record import Origin, Record, ZenohTime


class LogClock:
    """The wall clock when it was made, moved on by the monotonic clock: it is never set back."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the time, ns since 1970."""
        return self._offset_ns + time.monotonic_ns()

    def step_ns(self) -> int:
        """Return by how much the wall clock was set since this was made."""
        return time.time_ns() - self.now_ns()


def record_of(sample: zenoh.Sample, log_time_ns: int, origin: Origin = "stream") -> Record:
    """Return a copy of a sample of Zenoh's as a record."""
    attachment, stamp = sample.attachment, sample.timestamp
    return Record(
        key=str(sample.key_expr),
        payload=sample.payload.to_bytes(),
        encoding=str(sample.encoding),
        attachment=None if attachment is None else attachment.to_bytes(),
        timestamp=None if stamp is None else ZenohTime.parsed(str(stamp)),
        log_time_ns=log_time_ns,
        deleted=sample.kind == zenoh.SampleKind.DELETE,
        origin=origin,
        priority=int(cast(SupportsInt, sample.priority)),
        drops=sample.congestion_control == zenoh.CongestionControl.DROP,
        express=bool(sample.express),
    )
