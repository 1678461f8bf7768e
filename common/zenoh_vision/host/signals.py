"""SIGINT and SIGTERM as a request to stop, for as long as a node lives."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Replaces the handlers of the main thread, and puts the earlier ones back.

    Does nothing on another thread: handlers can be set on the main one only.

    Args:
        stop: Called on a signal; must be safe at any point of the program.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self._previous: dict[int, object] = {}

    def catch(self) -> None:
        """Set the handlers."""
        if threading.current_thread() is not threading.main_thread():
            return

        def on_signal(_number: int, _at: FrameType | None) -> None:
            self._stop()

        for number in SIGNALS:
            self._previous[number] = signal.signal(number, on_signal)

    def release(self) -> None:
        """Put the earlier handlers back."""
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._previous.clear()
