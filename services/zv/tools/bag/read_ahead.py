"""Reads records ahead on a thread, so that the disk delays none."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator

from zenoh_vision.host.wakeup import Wakeup
from zv.bag.record import Record

MOST_RECORDS = 256
MOST_BYTES = 32 << 20
POLL_S = 0.5


class ReadAhead:
    """The records of an iterator, in order, which another thread reads; one thread takes them."""

    def __init__(self, records: Iterator[Record]) -> None:
        self._records = records
        self._waiting: deque[Record] = deque()
        self._bytes = 0
        self._ended = False
        self._closed = False
        self._failure: BaseException | None = None
        self._filled = Wakeup()
        self._room = Wakeup()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._read, name="read ahead", daemon=True)
        self._thread.start()

    def next(self) -> Record | None:
        """Return the next record, None at the end.

        Raises:
            VisionError: Reading failed; after all that was read before.
        """
        while not self._waiting and not self._ended:
            self._filled.wait_for(lambda: self._waiting or self._ended, POLL_S)
        if not self._waiting:
            if self._failure is not None:
                raise self._failure
            return None
        record = self._waiting.popleft()
        with self._lock:
            self._bytes -= len(record.payload)
        self._room.set()
        return record

    def close(self) -> None:
        """End the thread, and wait for it: nothing is read any more."""
        self._closed = True
        self._room.set()
        self._thread.join()

    def _read(self) -> None:
        try:
            for record in self._records:
                self._waiting.append(record)
                with self._lock:
                    self._bytes += len(record.payload)
                self._filled.set()
                while not self._closed and not self._has_room():
                    self._room.wait_for(lambda: self._closed or self._has_room(), POLL_S)
                if self._closed:
                    return
        except BaseException as error:
            self._failure = error
        finally:
            self._ended = True
            self._filled.set()

    def _has_room(self) -> bool:
        return len(self._waiting) < MOST_RECORDS and self._bytes < MOST_BYTES
