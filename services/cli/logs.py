"""The form of the log: one line an entry, tracebacks only for who asks for them."""

from __future__ import annotations

import logging
from copy import copy

FORM = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"
TIME = "%H:%M:%S"


class LogLine(logging.Formatter):
    """Writes an entry as one line; an exception in it by its name and message.

    Args:
        debug: Show tracebacks instead.
    """

    def __init__(self, *, debug: bool) -> None:
        super().__init__(FORM, TIME)
        self._debug = debug

    def format(self, record: logging.LogRecord) -> str:
        """Return the entry as text."""
        error = record.exc_info[1] if record.exc_info else None
        if self._debug or error is None:
            return super().format(record)
        plain = copy(record)
        plain.exc_info = plain.exc_text = None
        words = " ".join(f"{type(error).__name__}: {error}".split())
        return f"{super().format(plain)}: {words} (--debug shows where)"
