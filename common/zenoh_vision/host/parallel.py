"""Runs the parts of one piece of work on several processors at once.

Only work that releases the interpreter, such as that of an image codec, becomes faster by it.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any, Final, TypeVar

T = TypeVar("T")

MAX_THREADS: Final = 8
MOST_WAITING: Final = 64
"""Most parts in the queue of the threads; the caller runs further ones itself. A part that the
caller has run stays there until a thread takes it out, which takes longer than to run a small one.
"""

MAX_BY_DEFAULT: Final = 4
"""Most threads unless more are asked for: each part has a fixed cost too."""


class Workers:
    """Threads that take parts of the work of those that call ``run``; made when needed."""

    def __init__(self) -> None:
        self._wanted = 0
        self.forget()

    def forget(self) -> None:
        """Make new threads at the next call, for a forked process, which has none of them."""
        self._pool: ThreadPoolExecutor | None = None
        self._native_ids: list[int] = []
        self._lock = threading.Lock()
        self._waiting = 0  # parts in the queue, also those that a caller has run by now

    def limit(self, threads: int) -> None:
        """Set how many threads work on one call of ``run``, the caller included.

        By default, and with 0, it is one for each processor of this process, at most
        ``MAX_BY_DEFAULT``.
        """
        with self._lock:
            pool, self._pool, self._native_ids, self._wanted = self._pool, None, [], threads
        if pool is not None:
            pool.shutdown(wait=False)

    @property
    def threads(self) -> int:
        """How many threads work on one call of ``run``, the caller included."""
        if self._wanted:
            return self._wanted
        has_affinity = hasattr(os, "sched_getaffinity")
        own = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
        return min(MAX_BY_DEFAULT, own)

    def run(self, functions: Sequence[Callable[[], T]]) -> list[T]:
        """Return the results of functions, in their order; when it returns, none is running.

        The caller runs the first one, and all that no thread has begun by then. It waits for those
        that were begun.
        """
        # Whoever takes the function out of a part runs it. The queue of the threads may hold the
        # part for longer than what the function refers to should last.
        parts = [[function] for function in functions]
        futures: list[Future[T | None] | None] = [None] * len(parts)
        if len(parts) > 1:
            begun = self._submit(parts[1:])
            futures[1 : len(begun) + 1] = begun
        found: list[T | None] = [None] * len(parts)
        try:
            for number, part in enumerate(parts):
                if (function := _taken(part)) is not None:
                    futures[number] = None
                    found[number] = function()
            for number, future in enumerate(futures):
                if future is not None:
                    found[number] = future.result()
            return found  # type: ignore[return-value]
        except BaseException:
            for part, future in zip(parts, futures, strict=True):
                if _taken(part) is None and future is not None:
                    wait([future])  # it may use memory that the caller takes back
            raise

    def _submit(self, parts: Sequence[list[Callable[[], T]]]) -> list[Future[T | None]]:
        """Hand parts to the threads, and return those that could be."""
        with self._lock:
            parts = parts[: max(0, MOST_WAITING - self._waiting)]
            pool, ids = self._pool, self._native_ids
            if pool is None:
                if (others := self.threads - 1) < 1:
                    return []
                self._pool = pool = ThreadPoolExecutor(
                    others, "part", lambda: ids.append(threading.get_native_id())
                )
        allowed = self._keep_off()
        found: list[Future[T | None]] = []
        with suppress(RuntimeError):  # too many threads, or the interpreter or the pool is ending
            for part in parts:
                found.append(pool.submit(self._run, part, allowed))
                with self._lock:
                    self._waiting += 1
        return found

    def _run(self, part: list[Callable[[], T]], allowed: set[int]) -> T | None:
        with self._lock:
            self._waiting -= 1
        function = _taken(part)
        if function is None:
            return None
        if allowed:
            _bind(0, allowed)  # from here on it may go to any processor that is idle
        return function()

    def _keep_off(self) -> set[int]:
        """Have the threads wake up on other processors than the caller's; return all if there are.

        Linux wakes a thread on the processor of the one that woke it, to run after it, if it does
        not know which processors share a cache, as in many virtual machines.
        """
        if _current_processor is None:
            return set()
        allowed = os.sched_getaffinity(0)
        others = allowed - {_current_processor()}
        if not others:
            return set()
        for thread in self._native_ids:
            _bind(thread, others)
        return allowed


def _taken(part: list[Callable[[], T]]) -> Callable[[], T] | None:
    """Take the function out of a part; None if another thread has done so."""
    try:
        return part.pop()
    except IndexError:
        return None


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
