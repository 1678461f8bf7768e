"""The queue between Zenoh's threads and the disk, limited in bytes."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import replace

from zv.bag.record import Record

RECORD_BYTES = 500
"""Memory that a record takes besides payload and attachment."""


def size_of(record: Record) -> int:
    """Return the bytes of memory that a record takes."""
    return RECORD_BYTES + len(record.payload) + len(record.attachment or b"")


class RecordQueue:
    """Records that wait, in the order of their arrival; what does not fit, without its bytes.

    Attributes:
        lost: How many of those that wait did not fit.
        lost_s: When the newest of them came, by ``time.monotonic``.
    """

    def __init__(self, limit_bytes: int) -> None:
        self._limit = limit_bytes
        self._records: deque[tuple[Record, bool]] = deque()
        self.lost = 0
        self.lost_s = -math.inf
        self._size = 0
        self._last_ns = 0
        self._ready = threading.Condition()

    def put(self, record: Record) -> None:
        """Add a record; does not wait. Its time of arrival is made later than that before it."""
        size = size_of(record)
        with self._ready:
            if record.log_time_ns <= self._last_ns:  # of two threads, the second was first here
                record = replace(record, log_time_ns=self._last_ns + 1)
            self._last_ns = record.log_time_ns
            fits = self._size + size <= self._limit
            if fits:
                self._size += size
            else:
                self.lost += 1
                self.lost_s = time.monotonic()
                record = replace(record, payload=b"")  # the account needs no more
            self._records.append((record, fits))
            if len(self._records) == 1:
                self._ready.notify()

    def take(self, timeout_s: float) -> list[tuple[Record, bool]]:
        """Return all records that wait, and whether they did fit; waits for the first."""
        with self._ready:
            if not self._records:
                self._ready.wait(timeout_s)
            records = list(self._records)
            self._records.clear()
            self.lost = 0
        return records

    def done(self, records: list[tuple[Record, bool]]) -> None:
        """Free the room of records that were taken."""
        with self._ready:
            self._size -= sum(size_of(record) for record, fits in records if fits)
