"""One child process: started, listened to, started again when it dies, ended in time."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import IO

from services.up.command import inherited
from services.up.lifeline import VARIABLE

FIRST_DELAY_S = 1.0
LAST_DELAY_S = 30.0
STEADY_S = 60.0
"""Who ran so long is not in a loop of crashes: the next delay is the first again."""

WRONG_CONFIGURATION = 2
MEANING = {
    WRONG_CONFIGURATION: "wrong configuration",
    3: "cannot open its source",
    4: "no router",
}


class Child:
    """A node's process over all its lives.

    ``state`` is ``starting``, ``running``, ``restarting in N s``, ``finished``, ``failed`` (down
    for good) or ``stopped`` (we ended it). Only ``say`` is called from another thread.

    Args:
        name: The node's.
        arguments: Behind ``zv``.
        restart: Whether it is started again when it dies.
        finishes: Whether it may come to an end of its work, and says so with exit status 0, as a
            camera whose file is over. Any other that ends was ended by someone, not by us.
        say: Called with a line to show the user.
        environment: Added to this process's own.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        *,
        restart: bool = True,
        finishes: bool = False,
        say: Callable[[str], None],
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.name = name
        self.state = "starting"
        self.pid: int | None = None
        self.exit_status: int | None = None
        self._arguments = list(arguments)
        self._restart = restart
        self._finishes = finishes
        self._say = say
        self._environment = dict(environment or {})
        self._process: subprocess.Popen[str] | None = None
        self._lifeline: int | None = None
        self._has_run = False
        self._started_s = 0.0
        self._delay_s = FIRST_DELAY_S
        self._again_s: float | None = None
        self._reader: threading.Thread | None = None

    def start(self) -> None:
        """Start the process; it ends when this one does, however this one ends."""
        reading, writing = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and modules
                # -P: a folder named services where the user happens to be is not ours.
                [sys.executable, "-P", "-m", "services", *self._arguments],
                env={**inherited(), **self._environment, VARIABLE: str(reading)},
                pass_fds=(reading,),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                start_new_session=True,  # a terminal's Ctrl-C is for us alone
            )
        except BaseException:
            os.close(writing)
            raise
        finally:
            os.close(reading)
        self._lifeline = writing
        self.pid = self._process.pid
        self.state, self.exit_status, self._again_s = "starting", None, None
        self._started_s = time.monotonic()
        assert self._process.stderr is not None
        self._reader = threading.Thread(
            target=self._pass_on, args=(self._process.stderr,), daemon=True
        )
        self._reader.start()

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    @property
    def age_s(self) -> float:
        """Seconds since its start."""
        return time.monotonic() - self._started_s

    def heard(self) -> None:
        """Take note that it does its work."""
        if self.alive:
            self.state, self._has_run = "running", True

    def look_after(self) -> None:
        """Take note of the process's end; start it again when it is time."""
        if self._again_s is not None:
            left_s = self._again_s - time.monotonic()
            if left_s <= 0:
                self.start()
            else:
                self.state = f"restarting in {left_s:.0f} s"
        elif self.pid is not None and not self.alive:
            assert self._process is not None
            self.pid, self.exit_status = None, self._process.returncode
            self._let_go()
            self._settle(self.exit_status)

    def _settle(self, status: int) -> None:
        """Decide what comes after the process's end."""
        how = ended_how(status)
        if status == 0 and self._finishes:
            self.state = "finished"
            self._say(f"{self.name} has finished")
        # Who has run before with the same flags is stopped by something that may pass.
        elif not self._restart or (status == WRONG_CONFIGURATION and not self._has_run):
            self.state = "failed"
            self._say(f"{self.name} {how}, not starting again")
        else:
            if self.age_s > STEADY_S:
                self._delay_s = FIRST_DELAY_S
            self._again_s = time.monotonic() + self._delay_s
            self.state = f"restarting in {self._delay_s:.0f} s"
            self._say(f"{self.name} {how}, starting again in {self._delay_s:g} s")
            self._delay_s = min(2 * self._delay_s, LAST_DELAY_S)

    def terminate(self) -> None:
        """Ask it to end, and do not start it again."""
        self._again_s = None
        if self.alive and self._process is not None:
            self._process.terminate()

    def finish(self, deadline_s: float) -> None:
        """Wait for its end until a monotonic time, then end it by force."""
        if self._process is not None:
            try:
                self._process.wait(max(0.0, deadline_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                self._say(f"{self.name} did not end in time: killed")
                self._process.kill()
                self._process.wait()
            if self._reader is not None:
                self._reader.join(0.2)
        self._let_go()
        self.pid = None
        if self.state not in ("finished", "failed"):
            self.state = "stopped"

    def _let_go(self) -> None:
        if self._lifeline is not None:
            os.close(self._lifeline)
            self._lifeline = None

    def _pass_on(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                text = line.rstrip().removeprefix("zv: ")
                self._say(text if f"{self.name}: " in text else f"{self.name}: {text}")


def ended_how(status: int) -> str:
    """Say how a process ended, from its status."""
    if status < 0:
        return f"died (signal {-status})"
    meaning = f" ({MEANING[status]})" if status in MEANING else ""
    return f"ended with status {status}{meaning}"
