"""One child process: started, listened to, started again when it dies, ended in time."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO

from services.up.lifeline import VARIABLE

FIRST_DELAY_S = 1.0
LAST_DELAY_S = 30.0
STEADY_S = 60.0
"""Who ran so long is not in a loop of crashes: the next delay is the first again."""

WRONG_CONFIGURATION = 2
ROOT = Path(__file__).parent.parent.parent


class Child:
    """A node's process over all its lives.

    Args:
        name: The node's.
        arguments: Behind ``zv``.
        restart: Whether it is started again when it dies. One that ends with 0 is finished,
            and one whose configuration is wrong would only end again: both stay down.
        say: Called with a line to show the user.
        environment: Added to this process's own.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        *,
        restart: bool,
        say: Callable[[str], None],
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.name = name
        self.state = "starting"
        self.pid: int | None = None
        self.exit_status: int | None = None
        self._arguments = list(arguments)
        self._restart = restart
        self._say = say
        self._environment = dict(environment or {})
        self._process: subprocess.Popen[str] | None = None
        self._lifeline: int | None = None
        self._started_s = 0.0
        self._delay_s = FIRST_DELAY_S
        self._again_s: float | None = None
        self._reader: threading.Thread | None = None

    def start(self) -> None:
        """Start the process; it ends when this one does, however this one ends."""
        reading, writing = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and modules
                [sys.executable, "-m", "services", *self._arguments],
                env={**os.environ, **self._environment, VARIABLE: str(reading)},
                pass_fds=(reading,),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                start_new_session=True,  # a terminal's Ctrl-C is for us alone
            )
        finally:
            os.close(reading)
        self._lifeline = writing
        self.pid = self._process.pid
        self.state, self.exit_status, self._again_s = "running", None, None
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
    def over(self) -> bool:
        """Whether it has ended and will not be started again."""
        return not self.alive and self._again_s is None and self.state != "starting"

    def look_after(self) -> None:
        """Take note of the process's end; start it again when it is time."""
        now_s = time.monotonic()
        if self._again_s is not None:
            if now_s >= self._again_s:
                self.start()
            else:
                self.state = f"restart in {self._again_s - now_s:.0f} s"
            return
        if self._process is None or self.alive or self.exit_status is not None:
            return
        status = self._process.returncode
        self.exit_status, self.pid = status, None
        self._let_go()
        if status == 0:
            self.state = "finished"
            self._say(f"{self.name} has finished")
        elif status == WRONG_CONFIGURATION or not self._restart:
            self.state = "failed"
            self._say(f"{self.name} {ended_how(status)} and is not started again")
        else:
            if now_s - self._started_s > STEADY_S:
                self._delay_s = FIRST_DELAY_S
            self._again_s = now_s + self._delay_s
            self._say(f"{self.name} {ended_how(status)}, starting it again in {self._delay_s:g} s")
            self._delay_s = min(2 * self._delay_s, LAST_DELAY_S)

    def terminate(self) -> None:
        """Ask it to end."""
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
        self.state = "stopped"

    def _let_go(self) -> None:
        if self._lifeline is not None:
            os.close(self._lifeline)
            self._lifeline = None

    def _pass_on(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                text = line.rstrip()
                self._say(text if self.name in text else f"{self.name}: {text}")


def ended_how(status: int) -> str:
    """Say how a process ended, from its status."""
    return f"died (signal {-status})" if status < 0 else f"ended with status {status}"
