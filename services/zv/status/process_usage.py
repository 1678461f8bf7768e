"""CPU and memory of processes on this machine."""

from __future__ import annotations

from contextlib import suppress

import psutil

CLOCK_S = 2.0
"""Accuracy of a process's time of creation, which is counted in ticks since the machine's start."""

MAX_DESCENDANTS = 100
"""Most descendants of a process that are counted."""

LOADING_S = 120.0
"""Longest time from the start of a process to the start of its node."""


class ProcessUsage:
    """Measures CPU and memory of processes that start and end."""

    def __init__(self) -> None:
        self._processes: dict[int, psutil.Process] = {}
        self._descendants: dict[int, dict[int, psutil.Process]] = {}

    def begin(self, pid: int, started_s: float | None = None) -> None:
        """Begin to measure a process: CPU time is measured between two readings.

        Args:
            pid: Process id.
            started_s: Start time that its node reports, seconds since 1970. Ids are reused: a
                process that was not created shortly before this time is not the node's.
        """
        try:
            process = psutil.Process(pid)
            age_s = 0.0 if started_s is None else started_s - process.create_time()
            if not -CLOCK_S < age_s < LOADING_S:
                return
            process.cpu_percent()
        except psutil.Error:
            return  # it has ended
        self._processes[pid] = process

    def read(
        self, pid: int | None, *, descendants: bool = False
    ) -> tuple[float | None, float | None]:
        """Return CPU (percent of a core since the last reading) and memory (MB), if known.

        Args:
            pid: Process id.
            descendants: Whether to add CPU and memory of the processes that it has started.
        """
        process = None if pid is None else self._processes.get(pid)
        if process is None:
            return None, None
        try:
            cpu, memory_mb = process.cpu_percent(), process.memory_info().rss / 1e6
            found = process.children(recursive=True) if descendants else []
        except psutil.Error:
            self._processes.pop(process.pid, None)
            self._descendants.pop(process.pid, None)
            return None, None
        if descendants:
            known = self._descendants.get(process.pid, {})
            # CPU is measured between two readings of the same object.
            kept = {each.pid: known.get(each.pid, each) for each in found[:MAX_DESCENDANTS]}
            self._descendants[process.pid] = kept
            for each in kept.values():
                with suppress(psutil.Error):  # it has ended
                    cpu += each.cpu_percent()
                    memory_mb += each.memory_info().rss / 1e6
        return cpu, memory_mb
