"""Wakes threads that wait, with a fraction of the code that ``Condition`` and ``Event`` run.

Both run some fifty lines of Python for each wait. A thread that waits for the next frame of a
camera finds all of them in slow memory when it wakes, so that they take longer than its own work.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress


class Wakeup:
    """What threads wait for, each for a condition of its own; safe between threads."""

    def __init__(self) -> None:
        self._asleep: dict[int, threading.Lock] = {}  # of each thread that has waited

    def set(self) -> None:
        """Wake the threads that wait; those that do not will not wait the next time."""
        for lock in tuple(self._asleep.values()):
            if lock.locked():
                try:  # noqa: SIM105 - it runs for each frame
                    lock.release()
                except RuntimeError:
                    pass  # another thread did so at the same moment

    def wait(self, timeout_s: float) -> None:
        """Wait until ``set``, or for the time-out; it may end sooner for no reason."""
        thread = threading.get_ident()
        lock = self._asleep.get(thread)
        if lock is None:
            for ended in set(self._asleep).difference(sys._current_frames()):
                old = self._asleep.pop(ended, None)
                if old is not None:
                    with suppress(RuntimeError):  # it is not locked
                        old.release()  # a new thread of the same number may sleep on it
            lock = threading.Lock()
            lock.acquire()
            self._asleep[thread] = lock  # what was set before is not known: it returns at once
        else:
            lock.acquire(timeout=timeout_s)

    def wait_for(self, is_true: Callable[[], object], timeout_s: float) -> bool:
        """Wait until a condition is true, or for the time-out; return whether it is true.

        Args:
            is_true: Called after each ``set``, which must follow each change of it.
            timeout_s: Longest wait; with 0 the condition is only looked at.
        """
        if is_true():
            return True
        until_s = time.monotonic() + timeout_s
        while (left_s := until_s - time.monotonic()) > 0:
            self.wait(left_s)
            if is_true():
                return True
        return False
