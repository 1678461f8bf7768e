"""One child process: its command line, its start, its restarts, and its end within a time limit."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO
from urllib.parse import urlsplit

from zenoh_vision.config.settings import Secret, flag_of
from zenoh_vision.host import health_file, lifeline
from zenoh_vision.host.backoff import Backoff
from zv.launcher.launch_file import PlannedNode
from zv.registry import command_of as command_name

FIRST_DELAY_S = 1.0
LONGEST_DELAY_S = 30.0
STEADY_S = 60.0
"""A process that ran this long is not in a crash loop: its delay starts at the first one again."""

WRONG_CONFIGURATION = 2
MEANING = {
    WRONG_CONFIGURATION: "wrong configuration",
    3: "cannot open its source",
    4: "no router",
}

RESOLVED = ("ZV_CONNECT", "ZV_NAMESPACE", "ZV_ZENOH_CONFIG", "ZV_TIMEOUT", health_file.VARIABLE)
"""Variables that ``zv up`` resolves for its children, which get the values as flags if needed.

Only ``zv up`` itself writes the health file, for all of them.
"""

ROOT = Path(__file__).parent.parent.parent


class Child:
    """A node's process, started again when it dies.

    ``state`` is ``starting``, ``running``, ``restarting in N s``, ``finished``, ``failed`` (not
    started again) or ``stopped`` (ended by us).

    Args:
        name: Name of the node.
        arguments: Command-line arguments of ``zv``.
        restart: Whether to start it again when it dies.
        finishes: Whether exit status 0 means that its work is done, such as for a camera at the
            end of its file. Any other process with status 0 was stopped by someone else.
        say: Called with a line to show the user; from any thread.
        environment: Variables to add to the inherited ones.
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
        self._backoff = Backoff(FIRST_DELAY_S, LONGEST_DELAY_S)
        self._again_s: float | None = None

    def start(self) -> None:
        """Start the process; it ends when this process ends, for any reason."""
        reading, writing = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and modules
                # -P: do not import from a folder named zv in the working directory.
                [sys.executable, "-P", "-m", "zv", *self._arguments],
                env={**inherited(), **self._environment, lifeline.VARIABLE: str(reading)},
                pass_fds=(reading,),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                start_new_session=True,  # a terminal's Ctrl-C must reach only this process
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
            target=self._forward, args=(self._process.stderr,), daemon=True
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

    def mark_running(self) -> None:
        """Note that the process does its work."""
        if self.alive:
            self.state, self._has_run = "running", True

    def check(self) -> None:
        """Note the process's end, and start it again when its delay is over."""
        if self._again_s is not None:
            left_s = self._again_s - time.monotonic()
            if left_s <= 0:
                self.start()
            else:
                self.state = f"restarting in {left_s:.0f} s"
        elif self.pid is not None and not self.alive:
            assert self._process is not None
            self.pid, self.exit_status = None, self._process.returncode
            self._close_lifeline()
            self._plan_restart(self.exit_status)

    def _plan_restart(self, status: int) -> None:
        how = ended_how(status)
        if status == 0 and self._finishes:
            self.state = "finished"
            self._say(f"{self.name} has finished")
        # If it has run with the same flags before, the cause may be temporary.
        elif not self._restart or (status == WRONG_CONFIGURATION and not self._has_run):
            self.state = "failed"
            self._say(f"{self.name} {how}, not starting again")
        else:
            if self.age_s > STEADY_S:
                self._backoff.reset()
            delay_s = self._backoff.next_delay_s()
            self._again_s = time.monotonic() + delay_s
            self.state = f"restarting in {delay_s:.0f} s"
            self._say(f"{self.name} {how}, starting again in {delay_s:g} s")

    def terminate(self) -> None:
        """Ask the process to end, and do not start it again."""
        self._again_s = None
        if self.alive and self._process is not None:
            self._process.terminate()

    def finish(self, deadline_s: float) -> None:
        """Wait for the process to end until a monotonic time, then kill it."""
        if self._process is not None:
            try:
                self._process.wait(max(0.0, deadline_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                self._say(f"{self.name} did not end in time: killed")
                self._process.kill()
                self._process.wait()
            self._reader.join(0.2)
        self._close_lifeline()
        self.pid = None
        if self.state not in ("finished", "failed"):
            self.state = "stopped"

    def _close_lifeline(self) -> None:
        if self._lifeline is not None:
            os.close(self._lifeline)
            self._lifeline = None

    def _forward(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                text = line.rstrip().removeprefix("zv: ")
                self._say(text if f"{self.name}: " in text else f"{self.name}: {text}")


def ended_how(status: int) -> str:
    """Return how a process ended, by its exit status."""
    if status < 0:
        return f"died (signal {-status})"
    meaning = f" ({MEANING[status]})" if status in MEANING else ""
    return f"ended with status {status}{meaning}"


def command_of(node: PlannedNode) -> tuple[list[str], dict[str, str]]:
    """Return the command-line arguments that give a process its settings, and its environment.

    Defaults are left out. Secrets go by environment, since everyone on a machine can read the
    command lines of all processes.
    """
    flags = [command_name(node.service)]
    secret: dict[str, str] = {}
    model = type(node.settings)
    for name, field in model.model_fields.items():
        value = getattr(node.settings, name)
        if value == field.default and name != "camera":
            continue
        flag = flag_of(name)
        if isinstance(value, bool):
            flags.append(flag if value else f"--no-{flag[2:]}")
        elif Secret in map(type, field.metadata) or _has_user(str(value)):
            secret[f"{model.env_prefix}{name.upper()}"] = str(value)
        else:
            flags += [flag, str(value)]
    return flags, secret


def inherited() -> dict[str, str]:
    """Return the environment without the resolved variables, with our packages in the path."""
    found = {name: value for name, value in os.environ.items() if name not in RESOLVED}
    if ROOT.name not in ("site-packages", "dist-packages"):  # a checkout, perhaps not installed
        found["PYTHONPATH"] = os.pathsep.join(
            part for part in (str(ROOT), os.environ.get("PYTHONPATH")) if part
        )
    return found


def _has_user(text: str) -> bool:
    """Tell whether a setting is a URL with a user's name, and so perhaps a password."""
    try:
        return "://" in text and urlsplit(text).username is not None
    except ValueError:
        return False
