"""Counts the RTP packets that a network has lost, from libav's log: it says so nowhere else."""

from __future__ import annotations

import logging
import re
import threading
from typing import Final

import av.logging

MISSED: Final = re.compile(r"RTP: missed (\d+) packets")

_lock = threading.Lock()
_in_use = 0


class PacketLosses:
    """The losses that libav notes on the thread which receives, from ``start`` to ``stop``.

    Only in that time does libav write a log. The lines of other threads, and all that are about
    something else, are left out.
    """

    def __init__(self) -> None:
        self._capture = av.logging.Capture()
        self._lines: list[tuple[int, str, str]] = []

    def start(self) -> None:
        """Begin to listen; on the thread that receives."""
        _use(+1)
        self._capture = av.logging.Capture()
        self._lines = self._capture.__enter__()

    def taken(self) -> int:
        """Return how many packets were lost since the last call."""
        if not self._lines:
            return 0
        lines = [line for _, _, line in self._lines]
        self._lines.clear()
        return sum(int(found[1]) for line in lines if (found := MISSED.match(line)))

    def stop(self) -> None:
        """End it; on the same thread."""
        self._capture.__exit__(None, None, None)
        _use(-1)


def _use(change: int) -> None:
    """Let libav write its log while it is in use.

    Not always: a decoder with threads of its own would wait for Python with each line, and Python
    for the decoder, as it is closed.
    """
    global _in_use
    with _lock:
        _in_use += change
        if _in_use == change == 1:
            logging.getLogger("libav").setLevel(logging.CRITICAL + 1)
            av.logging.set_skip_repeated(False)  # each line is another loss
            av.logging.set_level(av.logging.WARNING)
        elif not _in_use:
            av.logging.set_level(None)
