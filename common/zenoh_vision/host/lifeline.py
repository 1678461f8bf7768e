"""What started this process: ends it when that is gone, even by SIGKILL.

``zv up`` keeps the writing end of a pipe and passes the reading end to each child. The kernel
closes the writing end when the process ends, for any reason.
"""

from __future__ import annotations

import os
import signal
import threading

VARIABLE = "ZV_LIFELINE"
GRACE_S = 1.5

SUPERVISED_VARIABLE = "ZV_SUPERVISED"
"""Set by ``zv up`` for its nodes, by the container image, and by the units for systemd."""

LAUNCHED = "zv up"
"""The value that ``zv up`` gives it."""


def is_supervised() -> bool:
    """Tell whether something starts this process again when it ends."""
    return bool(os.environ.get(SUPERVISED_VARIABLE))


def is_launched() -> bool:
    """Tell whether ``zv up`` started this process, and decides by its status on another start."""
    return os.environ.get(SUPERVISED_VARIABLE) == LAUNCHED


def end_with_parent() -> None:
    """Send SIGTERM to this process when its parent is gone, and exit ``GRACE_S`` later.

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
