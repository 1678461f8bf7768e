"""Has one file reach the disk, on a thread that waits for the disk instead of the recorder."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

from zenoh_vision.error_text import printable
from zv.bag.record import RecordingError
from zv.bag.writer import Writer


class Syncer:
    """Has the name of a file reach the disk at once, what is written when told, and its end.

    Each file has a thread of its own: the next file does not wait until the one before is closed.

    Args:
        writer: Of the file. Once ``end`` was called, it belongs to the thread.

    Attributes:
        writer: Of the file.
        failure: What the disk said; empty if nothing.
        path: The file once it is closed and has its name; None before.
    """

    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        self.failure = ""
        self.path: Path | None = None
        self._is_due = threading.Event()
        self._last: Callable[[], Path | None] | None = None
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)
        self._thread.start()

    def sync(self) -> None:
        """Begin to sync the file, or do it again after the sync that goes on; does not wait."""
        self._is_due.set()

    def end(self, *, is_complete: bool) -> None:
        """Begin to close the file, which gets its name if it is complete; does not wait."""
        self._last = self.writer.publish if is_complete else self.writer.abandon
        self._is_due.set()

    @property
    def has_ended(self) -> bool:
        """Whether the file is closed, or cannot be."""
        return not self._thread.is_alive()

    def wait(self) -> None:
        """Wait until the file is closed, or cannot be."""
        self._thread.join()

    def _run(self) -> None:
        self._attempt(self.writer.sync_name)
        while self._last is None:
            self._is_due.wait()
            self._is_due.clear()
            if self._last is None:
                self._attempt(self.writer.sync)
        self.path = self._attempt(self._last)
        self.writer.abandon()

    def _attempt(self, step: Callable[[], Path | None]) -> Path | None:
        try:
            done = step()
        except (OSError, RecordingError) as error:
            self.failure = said(error)
            return None
        self.failure = ""
        return done


def said(error: Exception) -> str:
    """Return what the disk said, for a person."""
    return printable(
        os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
    )
