"""Remembers the threads that nobody waits for, since the interpreter cannot end while they run.

A daemon thread that is in OpenCV when Python's interpreter ends is ended inside C++, which aborts
the whole process with status 134; for one that opens a Zenoh session the interpreter would wait.
"""

from __future__ import annotations

from threading import Thread
from weakref import WeakSet

_ABANDONED: WeakSet[Thread] = WeakSet()


def abandon(thread: Thread) -> None:
    """Remember a thread that may run for longer than its process should wait."""
    _ABANDONED.add(thread)


def any_is_alive() -> bool:
    """Tell whether such a thread is still running: then the process must end at once."""
    return any(thread.is_alive() for thread in list(_ABANDONED))
