"""SIGINT and SIGTERM as a request to stop, for as long as a node or another piece of work lives."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Self

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Replaces the handlers of the main thread within a ``with`` block.

    Does nothing on another thread: handlers can be set on the main one only.

    Args:
        stop: Called on a signal; must be safe at any point of the program.

    Attributes:
        stopping: Whether a signal came.
    """

    def __init__(self, stop: Callable[[], None] = lambda: None) -> None:
        self.stopping = False
        self._stop = stop
        self._previous: dict[int, object] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_error: object) -> None:
        """Put the earlier handlers back."""
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._previous.clear()

    def _on_signal(self, _number: int, _at: FrameType | None) -> None:
        self.stopping = True
        self._stop()
