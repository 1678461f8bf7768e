"""A process that ends when the one that started it is gone, even by SIGKILL.

``zv up`` holds the writing end of a pipe and passes the reading end; the kernel closes the
writing end with its process, whatever ended it.
"""

from __future__ import annotations

import os
import signal
import threading

VARIABLE = "ZV_LIFELINE"
GRACE_S = 1.5


def end_with_parent() -> None:
    """End this process in order, and by force after ``GRACE_S``, when the parent is gone.

    Does nothing in a process that was not started by ``zv up``.
    """
    descriptor = os.environ.pop(VARIABLE, None)
    if descriptor is None:
        return

    def watch() -> None:
        os.read(int(descriptor), 1)  # returns only when the other end is closed
        os.kill(os.getpid(), signal.SIGTERM)
        threading.Event().wait(GRACE_S)
        os._exit(1)

    threading.Thread(target=watch, name="lifeline", daemon=True).start()
