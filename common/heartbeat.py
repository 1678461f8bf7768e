"""A file that says whether the process does its work, for a container's health check.

The check only looks at the file: written within the last seconds, and its first word is ``ok``.
That costs no interpreter, and a process that is frozen or gone writes nothing, so that it too is
found out.
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


class Heartbeat:
    """Writes how the process does, at most once a period unless that changes.

    Without a path, by the environment variable ``ZV_HEALTH_FILE`` or by argument, it does nothing.
    A file that cannot be written is said once and stops nothing.

    Args:
        path: The file; None takes the environment's.
    """

    def __init__(self, path: str | None = None) -> None:
        named = os.environ.get(VARIABLE) if path is None else path
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
            if words != self._written or not self._touched(self._path):
                self._replace(self._path, words)
        except OSError as error:
            if not self._failed:
                log.warning("%s %s: %s", VARIABLE, self._path, error.strerror or error)
            self._failed = True
            return
        self._written, self._failed = words, False

    @staticmethod
    def _touched(path: Path) -> bool:
        """Set the time of the file alone, which a full disk allows; False if it is gone."""
        try:
            os.utime(path)
        except FileNotFoundError:
            return False
        return True

    @staticmethod
    def _replace(path: Path, words: str) -> None:
        """Swap the file as a whole: who reads it meanwhile must not find it empty."""
        new = path.with_name(f".{path.name}.{os.getpid()}")
        new.write_text(words)
        new.replace(path)
