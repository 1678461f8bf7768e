"""What waits for one page: of what replaces one another the newest, of all else not too much."""

from __future__ import annotations

from collections.abc import Callable, Hashable

MAX_TEXTS = 1000


class Outbox:
    """Texts for one page, in their order.

    Args:
        ready: Called when there is one.
    """

    def __init__(self, ready: Callable[[], None]) -> None:
        self._ready = ready
        self._texts: dict[Hashable, str] = {}
        self._number = 0

    def put(self, text: str, replaces: Hashable | None = None) -> None:
        """Leave a text; it takes the place of one that waits under the same name."""
        if replaces is None:
            self._number += 1
            replaces = self._number
        self._texts.pop(replaces, None)
        self._texts[replaces] = text
        self._ready()

    @property
    def full(self) -> bool:
        """Whether the page has not read for so long that it is to be left."""
        return len(self._texts) > MAX_TEXTS

    def take(self) -> str | None:
        """Return the oldest that waits."""
        if not self._texts:
            return None
        return self._texts.pop(next(iter(self._texts)))
