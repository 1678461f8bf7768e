"""Writes the output of ``zv up`` on threads of its own, so that it goes on while nobody reads it.

A pager, a terminal after Ctrl-S and a program that hangs read nothing: whoever writes to them
waits, and would neither start a node again nor end.
"""

from __future__ import annotations

import io
import logging
import os
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, TextIO

MOST_CHARACTERS: Final = 1_000_000
"""Most text that waits for a reader; further lines are counted and lost."""

END_S: Final = 1.0
"""Time for each reader to take what waits at the end."""


@contextmanager
def written_on_threads() -> Iterator[None]:
    """Write standard output, standard error and the log on threads, so that nobody waits.

    Raises:
        OSError: The last lines of standard output could not be written.
    """
    before = sys.stdout, sys.stderr
    out = ThreadedStream(before[0])
    lead_to_one = os.path.sameopenfile(before[0].fileno(), before[1].fileno())
    err = out if lead_to_one else ThreadedStream(before[1])  # so lines stay in order
    sys.stdout, sys.stderr = out, err
    logs = [each for each in logging.getLogger().handlers if type(each) is logging.StreamHandler]
    for each in logs:
        each.setStream(sys.stderr)
    try:
        yield
    finally:
        ended = [each for each in {out, err} if each.end(END_S)]
        # Where nobody reads to the end either, whatever else is written must not wait.
        if out in ended:
            sys.stdout = before[0]
        if err in ended:
            sys.stderr = before[1]
            for each in logs:
                each.setStream(sys.stderr)
    out.write("")  # raises the error of an earlier write


class ThreadedStream(io.TextIOBase):
    """A stream of text that another thread writes to a file descriptor.

    ``write`` raises the error of an earlier write, such as that the reader is gone.

    Args:
        stream: Its file descriptor is written; nothing else should write there meanwhile.
    """

    def __init__(self, stream: TextIO) -> None:
        stream.flush()
        self._stream = stream
        self._descriptor = os.dup(stream.fileno())  # open until the thread ends
        self._part = ""
        self._texts: deque[str] = deque()
        self._waiting = 0  # characters that are in the queue or being written
        self._lost = 0
        self._ending = False
        self._changed = threading.Condition()
        self._error: OSError | None = None
        self._thread = threading.Thread(target=self._run, name="output", daemon=True)
        self._thread.start()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """That of the stream."""
        return self._stream.encoding

    def isatty(self) -> bool:
        """Tell whether it is a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Return the file descriptor of the stream."""
        return self._stream.fileno()

    def write(self, text: str) -> int:
        """Write the lines of a text soon, and the rest with the next line or ``flush``."""
        with self._changed:
            if self._error is not None:
                raise self._error.with_traceback(None)  # else each raise adds to it
            self._part += text
            if "\n" in text:
                self._put()
        return len(text)

    def flush(self) -> None:
        """Write soon what does not end with a line."""
        with self._changed:
            self._put()

    def end(self, within_s: float) -> bool:
        """End the thread once all is written, or cannot be; return whether it has in time."""
        self.flush()
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _put(self) -> None:
        text, self._part = self._part, ""
        if self._waiting + len(text) > MOST_CHARACTERS:
            self._lost += text.count("\n")
        elif text:
            self._texts.append(text)
            self._waiting += len(text)
            self._changed.notify_all()

    def _run(self) -> None:
        try:
            while text := self._next():
                rest = memoryview(text.encode(self.encoding, "backslashreplace"))
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
        except OSError as error:
            with self._changed:
                self._error = error
        finally:
            os.close(self._descriptor)

    def _next(self) -> str:
        """Return all text that waits, and does until the next call; at the end, an empty one."""
        with self._changed:
            self._waiting = sum(map(len, self._texts))
            self._changed.wait_for(lambda: self._texts or self._ending)
            text = "".join(self._texts)
            self._texts.clear()
            lost, self._lost = self._lost, 0
        said = f"zv up: {lost} lines were lost here, since nobody read them\n" if lost else ""
        return text + said
