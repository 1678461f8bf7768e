"""Runs the parts of one piece of work on several processors at once.

Only work that releases the interpreter, such as that of an image codec, becomes faster by it.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import SimpleQueue
from typing import Any, Final, Generic, TypeVar

T = TypeVar("T")

MAX_THREADS: Final = 8
MAX_BY_DEFAULT: Final = 4
"""Most threads unless more are asked for: each part has a fixed cost too."""


class Part(Generic[T]):
    """A function that is run once, by the first thread that comes to it."""

    def __init__(self, function: Callable[[], T]) -> None:
        self._function: Callable[[], T] | None = function
        self._claim = threading.Lock()
        self._ended = threading.Lock()
        self._ended.acquire()
        self._found: list[T] = []
        self._error: BaseException | None = None

    def run(self) -> None:
        """Run the function, unless a thread has begun to."""
        if not self._claim.acquire(blocking=False):
            return
        try:
            # A queue may hold this for longer than what the function refers to should last.
            function, self._function = self._function, None
            if function is not None:
                self._found.append(function())
        except BaseException as error:
            self._error = error
        finally:
            self._ended.release()

    def abandon(self) -> None:
        """Prevent that it is run; if it is being run, wait for its end. Its outcome is lost."""
        if self._claim.acquire(blocking=False):
            self._function = None
        else:
            with self._ended:
                self._found.clear()
                self._error = None

    def result(self) -> T:
        """Wait for the end, and return the result, which is not kept, or raise the error."""
        with self._ended:
            error = self._error
        if error is None:
            return self._found.pop()
        try:
            raise error
        finally:
            del error  # else it would refer to itself, by its traceback and this frame


class Crew:
    """Threads that run parts until they are dismissed; they do not keep a process alive."""

    def __init__(self, count: int) -> None:
        self.waiting = SimpleQueue[Part[Any] | None]()
        self._threads: list[threading.Thread] = []
        self._allowed: set[int] = set()
        for number in range(count):
            thread = threading.Thread(target=self._run, name=f"part {number}", daemon=True)
            try:
                thread.start()
            except RuntimeError:  # there are too many threads, or the interpreter is ending
                break
            self._threads.append(thread)

    def dismiss(self) -> None:
        """Let the threads end, each after the part that it runs."""
        for _ in self._threads:
            self.waiting.put(None)

    def keep_off(self) -> None:
        """Have the threads wake up on other processors than the caller's.

        Linux wakes a thread on the processor of the one that woke it, to run after it, if it does
        not know which processors share a cache, as in many virtual machines.
        """
        if _current_processor is None:
            return
        allowed = os.sched_getaffinity(0)
        others = allowed - {_current_processor()}
        if not others:
            return
        self._allowed = allowed
        for thread in self._threads:
            if thread.native_id is not None and thread.is_alive():  # else it is another's number
                _bind(thread.native_id, others)

    def _run(self) -> None:
        while (part := self.waiting.get()) is not None:
            if self._allowed:
                _bind(0, self._allowed)  # from here on it may go to any processor that is idle
            part.run()
            del part


class Workers:
    """Threads that take parts of the work of those that call ``run``; made when needed."""

    def __init__(self) -> None:
        self._wanted = 0
        self._crew: Crew | None = None
        self._lock = threading.Lock()

    def limit(self, threads: int) -> None:
        """Set how many threads work on one call of ``run``, the caller included.

        By default, and with 0, it is one for each processor of this process, at most
        ``MAX_BY_DEFAULT``.
        """
        with self._lock:
            crew, self._crew, self._wanted = self._crew, None, threads
        if crew is not None:
            crew.dismiss()

    @property
    def threads(self) -> int:
        """How many threads work on one call of ``run``, the caller included."""
        return self._wanted or min(MAX_BY_DEFAULT, _processors())

    def run(self, functions: Sequence[Callable[[], T]]) -> list[T]:
        """Return the results of functions, in their order; when it returns, none is running.

        The caller runs the first one, and all that no thread has begun by then. It waits for those
        that were begun.
        """
        crew = self._crew_of(self.threads - 1) if len(functions) > 1 else None
        if crew is None:
            return [function() for function in functions]
        parts = [Part(function) for function in functions]
        try:
            crew.keep_off()
            for part in parts[1:]:
                crew.waiting.put(part)
            for part in parts:
                part.run()
            return [part.result() for part in parts]
        except BaseException:
            for part in parts:  # they may use memory that the caller takes back
                part.abandon()
            raise

    def forget(self) -> None:
        """Make new threads at the next call, for a forked process, which has none of them."""
        self._crew, self._lock = None, threading.Lock()

    def _crew_of(self, count: int) -> Crew | None:
        if count < 1:
            return None
        with self._lock:
            if self._crew is None:
                self._crew = Crew(count)
            return self._crew


def _processors() -> int:
    """Return how many processors the calling thread may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _bind(thread: int, processors: set[int]) -> None:
    with suppress(OSError):  # it has ended, or the processors have been taken from this process
        os.sched_setaffinity(thread, processors)


_current_processor: Any = (
    getattr(ctypes.CDLL(None), "sched_getcpu", None) if hasattr(os, "sched_setaffinity") else None
)

workers = Workers()
"""The threads that all JPEGs of this process share."""

if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=workers.forget)
