"""Ends process groups that a process has started when it is gone, even by SIGKILL.

Services watch their parent themselves, see ``zenoh_vision.host.lifeline``. Other programs do not:
those of a launch file, and a camera's source. So one more process ends them all: this file, run as
a script. It is told the groups through a pipe, whose end the kernel closes when the process that
started them ends for any reason.

The script imports nothing but the standard library, so that it starts fast and stays small.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

POLL_S = 0.02


class GroupGuard:
    """Runs the process that ends the groups; starts it with the first group.

    Args:
        grace_s: How long after SIGTERM the groups that are left are killed.
    """

    def __init__(self, grace_s: float) -> None:
        self._grace_s = grace_s
        self._process: subprocess.Popen[bytes] | None = None
        self._groups: set[int] = set()

    def add(self, group: int) -> None:
        """Have a process group ended when this process is gone.

        Raises:
            OSError: The guard cannot be started; the next ``add`` tries again.
        """
        self._groups.add(group)
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and file
                [sys.executable, "-I", "-S", __file__, str(self._grace_s)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # a signal for the group of its parent must not end it
            )
            for each in self._groups:
                self._tell(f"+{each}\n")
        else:
            self._tell(f"+{group}\n")

    def remove(self, group: int) -> None:
        """Forget a group that has ended, since its number may be used again."""
        self._groups.discard(group)
        self._tell(f"-{group}\n")

    def close(self) -> None:
        """End the guard without ending the groups, which the caller has ended."""
        if self._process is not None:
            assert self._process.stdin is not None
            self._process.kill()
            self._process.wait()
            with suppress(OSError):
                self._process.stdin.close()
            self._process = None

    def _tell(self, line: str) -> None:
        if self._process is not None:
            assert self._process.stdin is not None
            with suppress(OSError):  # it was killed: the next group starts another
                self._process.stdin.write(line.encode())
                self._process.stdin.flush()


def signal_group(group: int, number: int) -> bool:
    """Send a signal to a process group; return whether any process of it exists."""
    try:
        os.killpg(group, number)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def end_group(group: int, deadline_s: float) -> bool:
    """Wait for a process group to end until a monotonic time, then kill it.

    Returns:
        Whether all its processes had ended in time.
    """
    while signal_group(group, 0):
        with suppress(ChildProcessError):  # orphans are children of process 1
            os.waitpid(-group, os.WNOHANG)
        if time.monotonic() >= deadline_s:
            signal_group(group, signal.SIGKILL)
            return False
        time.sleep(POLL_S)
    return True


def main() -> None:
    """Read ``+GROUP`` and ``-GROUP`` lines until the pipe is closed, then end the groups left."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    groups: set[int] = set()
    for line in sys.stdin:
        (groups.add if line[0] == "+" else groups.discard)(int(line[1:]))
    for group in groups:
        signal_group(group, signal.SIGTERM)
    deadline_s = time.monotonic() + float(sys.argv[1])
    for group in groups:
        end_group(group, deadline_s)


if __name__ == "__main__":
    main()
