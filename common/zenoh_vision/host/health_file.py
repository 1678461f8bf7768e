"""Writes the health of the process to a file, for a container's health check.

The check only reads the file: it must be a few seconds old at most, and its first word ``ok``.
This needs no interpreter, and it detects a process that is frozen or gone.
"""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path

log = logging.getLogger(__name__)

VARIABLE = "ZV_HEALTH_FILE"
PERIOD_S = 1.0
MAX_WORDS = 500


class HealthFile:
    """Writes the state of the process, at most once a period unless it changes.

    Without the environment variable ``ZV_HEALTH_FILE``, it does nothing.
    A file that cannot be written is logged once and stops nothing.
    """

    def __init__(self) -> None:
        named = os.environ.get(VARIABLE)
        self._path = Path(named) if named else None
        self._written = ""
        self._due_s = 0.0
        self._failed = False

    def beat(self, trouble: str = "") -> None:
        """Write ``ok``, or what is wrong."""
        if self._path is None:
            return
        words = f"trouble: {' '.join(trouble.split())[:MAX_WORDS]}\n" if trouble else "ok\n"
        now_s = time.monotonic()
        if words == self._written and now_s < self._due_s:
            return
        self._due_s = now_s + PERIOD_S / 2
        try:
            # Updating its time alone needs no space, so it works on a full disk.
            if words == self._written and self._path.exists():
                os.utime(self._path)
            else:
                # The file is replaced as a whole: a reader must not find it empty.
                new = self._path.with_name(f".{self._path.name}.{os.getpid()}")
                new.write_text(words)
                new.replace(self._path)
        except OSError as error:
            if not self._failed:
                log.warning("%s %s: %s", VARIABLE, self._path, error.strerror or error)
            self._failed = True
            return
        self._written, self._failed = words, False
