"""Limits the CPU use of a process: threads of OpenCV and NumPy, niceness, affinity."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Collection
from contextlib import suppress

from zenoh_vision.errors import ConfigurationError

RANGE = re.compile(r"(\d{1,4})(?:-(\d{1,4}))?")


def processors_of(text: str) -> frozenset[int]:
    """Return the processors of a list such as ``0,2-3``.

    Raises:
        ValueError: It is no such list.
    """
    found: set[int] = set()
    for part in text.split(","):
        match = RANGE.fullmatch(part)
        if match is None:
            raise ValueError("not a list of processors")
        first, last = int(match[1]), int(match[2] or match[1])
        if first > last:
            raise ValueError(f"{part} ends before it begins")
        found.update(range(first, last + 1))
    return frozenset(found)


def use_processors(threads: int, nice: int, affinity: Collection[int]) -> None:
    """Limit this process, with the threads that it has, and those that it starts later.

    Args:
        threads: How many threads an OpenCV or NumPy call may use; 0 is one for each processor.
            NumPy is not limited if it is loaded already.
        nice: The niceness, -20 to 19; 0 leaves it as it is.
        affinity: The processors that it may run on; empty is all.

    Raises:
        ConfigurationError: The machine does not allow it, or has no such processor.
    """
    if threads:
        # Set by their environment variables, so that programs without pictures load neither. The
        # threads of NumPy's BLAS busy-wait as soon as it is loaded: 60 ms of CPU on two processors.
        os.environ["OPENCV_FOR_THREADS_NUM"] = str(threads)
        os.environ.setdefault("OPENBLAS_NUM_THREADS", str(threads))
        if "cv2" in sys.modules:
            sys.modules["cv2"].setNumThreads(threads)
    if nice:
        try:
            _of_each_thread(lambda thread: os.setpriority(os.PRIO_PROCESS, thread, nice))
        except PermissionError:
            raise ConfigurationError(
                f"nice = {nice} is not permitted to this user; allowed: "
                f"{os.getpriority(os.PRIO_PROCESS, 0)} to 19"
            ) from None
    if affinity:
        _run_on(affinity)


def _run_on(affinity: Collection[int]) -> None:
    wanted = ",".join(map(str, sorted(affinity)))
    if not hasattr(os, "sched_setaffinity"):
        raise ConfigurationError(f"affinity = {wanted} is not possible on {sys.platform}")
    there = sorted(os.sched_getaffinity(0))
    if not {*affinity} <= {*there}:
        raise ConfigurationError(
            f"affinity = {wanted} names a processor that this process may not use; allowed: of "
            f"{','.join(map(str, there))}"
        )
    _of_each_thread(lambda thread: os.sched_setaffinity(thread, affinity))


def _of_each_thread(limit: Callable[[int], None]) -> None:
    """Call a function with each thread of this process, since Linux limits one at a time."""
    try:
        threads = [int(name) for name in os.listdir("/proc/self/task")]
    except OSError:
        threads = [0]  # 0 is the calling thread on Linux, elsewhere the process
    for thread in threads:
        with suppress(ProcessLookupError):
            limit(thread)
