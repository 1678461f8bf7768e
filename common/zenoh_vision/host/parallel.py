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
MAX_BY_ITSELF: Final = 4
"""Most threads unless more are asked for: each part has a fixed cost too."""


class Workers:
    """Threads that take parts of the work of any thread that calls ``run``; made when needed."""

    def __init__(self) -> None:
        self._wanted = 0
        self._processors: set[int] = set()
        self._pool: ThreadPoolExecutor | None = None
        self._threads: list[int] = []
        self._placed: tuple[int, tuple[int, ...]] = -1, ()  # off which processor, which threads
        self._lock = threading.Lock()

    def limit(self, threads: int) -> None:
        """Set how many threads may work at once, the caller included.

        By default, and with 0, it is one for each processor of this process, at most
        ``MAX_BY_ITSELF``.
        """
        with self._lock:
            pool, self._pool = self._pool, None
            self._wanted, self._processors = threads, set()
        if pool is not None:
            pool.shutdown()

    @property
    def threads(self) -> int:
        """How many threads may work at once, the caller included."""
        if not self._processors:
            self._processors = _own_processors()
        return self._wanted or min(MAX_BY_ITSELF, len(self._processors))

    def run(self, parts: Sequence[Callable[[], T]]) -> list[T]:
        """Return the results of functions, in their order; when it returns, none is running.

        The caller runs the first one, and all that no thread has begun meanwhile, so it does not
        wait for threads that get no processor on a busy machine.
        """
        if self.threads < 2 or len(parts) < 2:
            return [part() for part in parts]
        self._keep_apart()
        futures = self._submitted(parts[1:])
        try:
            found = [parts[0]()]
            own = {
                number: part()
                for number, (part, future) in enumerate(zip(parts[1:], futures, strict=True))
                if future is None or future.cancel()
            }
            for number, future in enumerate(futures):
                found.append(own[number] if future is None or number in own else future.result())
        except BaseException:
            # They may use memory that the caller takes back.
            wait([future for future in futures if future is not None and not future.cancel()])
            raise
        return found

    def _submitted(self, parts: Sequence[Callable[[], T]]) -> list[Future[T] | None]:
        """Give parts to the threads; None instead of a future if there are no threads any more."""
        with self._lock:
            if self._pool is None:
                self._threads = []
                self._pool = ThreadPoolExecutor(
                    self.threads - 1,
                    thread_name_prefix="part",
                    initializer=lambda: self._threads.append(threading.get_native_id()),
                )
            try:
                return [self._pool.submit(part) for part in parts]
            except RuntimeError:  # the interpreter is ending
                return [None] * len(parts)

    def _keep_apart(self) -> None:
        """Keep the threads off the caller's processor.

        Linux wakes a thread on the processor of the one that woke it, to run after it, if it does
        not know which processors share a cache, as in many virtual machines.
        """
        if _current_processor is None:
            return
        here, threads = _current_processor(), tuple(self._threads)
        if (here, threads) == self._placed:
            return
        self._placed = here, threads
        for thread in threads:
            with suppress(OSError):  # other processors have been taken from this process
                os.sched_setaffinity(thread, self._processors - {here})


def _own_processors() -> set[int]:
    """Return the processors that the calling thread may run on."""
    if hasattr(os, "sched_getaffinity"):
        return set(os.sched_getaffinity(0))
    return set(range(os.cpu_count() or 1))


_current_processor: Any = (
    getattr(ctypes.CDLL(None), "sched_getcpu", None) if hasattr(os, "sched_setaffinity") else None
)

workers = Workers()
"""Those of this process, for its pictures."""
