"""One place for the newest item, between a thread that brings and one that takes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Slot(Generic[T]):
    """Holds at most one item a lane; a newer one replaces it.

    Two lanes let a stream that is not proven yet (``challenger``) wait without displacing the
    items of the one that is.

    Args:
        replaced: Called with each item that a newer one displaced.
    """

    def __init__(self, replaced: Callable[[T], None]) -> None:
        self._replaced = replaced
        self._current: T | None = None
        self._challenger: T | None = None
        self._filled = threading.Condition()

    def put(self, item: T, *, challenger: bool = False) -> None:
        """Leave an item, displacing the one in its lane."""
        with self._filled:
            if challenger:
                displaced, self._challenger = self._challenger, item
            else:
                displaced, self._current = self._current, item
            self._filled.notify()
        if displaced is not None:
            self._replaced(displaced)

    @property
    def filled(self) -> bool:
        """Whether an item waits."""
        with self._filled:
            return self._current is not None or self._challenger is not None

    def take(self, timeout_s: float) -> T | None:
        """Return the item, the proven lane's first; None if there was none in time."""
        with self._filled:
            if self._current is None and self._challenger is None:
                self._filled.wait(timeout_s)
            item: T | None
            if self._current is not None:
                item, self._current = self._current, None
            else:
                item, self._challenger = self._challenger, None
            return item
