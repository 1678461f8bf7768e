"""Closing what another thread may be using."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Closing:
    """Frees a resource once, never under a running call.

    ``close`` comes from any thread. While another is ``using`` the resource it only leaves
    word, and that thread frees it when its call returns: C libraries crash when their memory
    goes away under them.

    Args:
        free: Frees the resource; called once.
    """

    def __init__(self, free: Callable[[], None]) -> None:
        self.closed = False
        self._free: Callable[[], None] | None = free
        self._lock = threading.Lock()

    @contextmanager
    def using(self) -> Iterator[None]:
        """Hold the resource, and free it afterwards if it was closed meanwhile."""
        try:
            with self._lock:
                yield
        finally:
            if self.closed:
                self.close()

    def close(self) -> None:
        """Free the resource, now or when it is not used any more; safe to call twice."""
        self.closed = True
        if not self._lock.acquire(blocking=False):
            return
        try:
            free, self._free = self._free, None
            if free is not None:
                free()
        finally:
            self._lock.release()
