"""CPU and memory of this machine's processes."""

from __future__ import annotations

import psutil


class Meter:
    """CPU and memory of processes that come and go."""

    def __init__(self) -> None:
        self._processes: dict[int, psutil.Process] = {}

    def begin(self, pid: int) -> None:
        """Start to measure a process, so that its first reading has something to go by."""
        try:
            process = psutil.Process(pid)
            process.cpu_percent()
        except psutil.Error:
            return  # it has ended already
        self._processes[pid] = process

    def read(self, pid: int | None) -> tuple[str, str]:
        """Return CPU (percent of a core since the last reading) and memory (MB)."""
        process = None if pid is None else self._processes.get(pid)
        if process is None:
            return "", ""
        try:
            return f"{process.cpu_percent():.0f}", f"{process.memory_info().rss / 1e6:.0f}"
        except psutil.Error:
            self._processes.pop(process.pid, None)
            return "", ""
