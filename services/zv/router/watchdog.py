"""Detects that a router has stopped answering for good, so that it can be restarted.

Zenoh 1.10 can lock up for ever when it lists publishers, subscribers or queryables in its admin
space while one is being declared (zenoh #2619). Its port still accepts connections then.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

HUNG_S: Final = 5.0
PERIOD_S: Final = 1.0
LAST_ANSWER_S: Final = 0.5
PAUSED_S: Final = 1.0
"""Longer time between two looks: this process was frozen, or the machine has no time for it."""


class Watchdog:
    """Queries a router periodically, on a thread of its own, since an answer may never come.

    Args:
        ask: Asks the router; returns once it has answered.
        clock: Returns monotonic seconds.
    """

    def __init__(
        self, ask: Callable[[], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._ask = ask
        self._clock = clock
        self._answered = threading.Event()
        self._ended = threading.Event()
        self._looked_s = self._answered_s = clock()
        self._thread = threading.Thread(target=self._go_on_asking, name="watchdog", daemon=True)
        self._thread.start()

    def hangs(self) -> bool:
        """Tell whether no answer has come for ``HUNG_S``; must be called often."""
        now_s = self._clock()
        if self._answered.is_set() or now_s - self._looked_s > PAUSED_S:
            self._answered.clear()
            self._answered_s = now_s
        self._looked_s = now_s
        return now_s - self._answered_s > HUNG_S

    def end(self, wait_s: float) -> bool:
        """Stop asking; tell whether the last question has been answered within a time."""
        self._ended.set()
        self._thread.join(wait_s)
        return not self._thread.is_alive()

    def _go_on_asking(self) -> None:
        while not self._ended.is_set():
            self._ask()
            self._answered.set()
            self._ended.wait(PERIOD_S)
