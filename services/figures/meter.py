"""CPU and memory of this machine's processes."""

from __future__ import annotations

import psutil

CREATED_S = 2.0
"""A process is told its time of creation in ticks of the clock since the machine's start."""

LOADED_S = 120.0
"""So long after a process was created its node has started."""


class Meter:
    """CPU and memory of processes that come and go."""

    def __init__(self) -> None:
        self._processes: dict[int, psutil.Process] = {}

    def begin(self, pid: int, started_s: float | None = None) -> None:
        """Start to measure a process, so that its first reading has something to go by.

        Args:
            pid: Of the process.
            started_s: When it says that it was started, s since 1970: an id is used again, and
                the process that has it now may be another.
        """
        try:
            process = psutil.Process(pid)
            age_s = 0.0 if started_s is None else started_s - process.create_time()
            if not -CREATED_S < age_s < LOADED_S:
                return
            process.cpu_percent()
        except psutil.Error:
            return  # it has ended already
        self._processes[pid] = process

    def read(self, pid: int | None) -> tuple[float | None, float | None]:
        """Return CPU (percent of a core since the last reading) and memory (MB), if known."""
        process = None if pid is None else self._processes.get(pid)
        if process is None:
            return None, None
        try:
            return process.cpu_percent(), process.memory_info().rss / 1e6
        except psutil.Error:
            self._processes.pop(process.pid, None)
            return None, None
