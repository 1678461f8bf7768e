"""Starts one child process, restarts it when it dies, and ends it within a time limit."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import IO

from zenoh_vision.host import lifeline
from zenoh_vision.host.backoff import Backoff
from zenoh_vision.host.group_guard import GroupGuard, end_group, signal_group
from zv.launcher.command_line import CommandLine

FIRST_DELAY_S = 1.0
LONGEST_DELAY_S = 30.0
STEADY_S = 60.0
"""A process that ran this long is not in a crash loop: its delays begin again with the first."""

WRONG_CONFIGURATION = 2
CANNOT_EXECUTE = 127
MEANING = {
    WRONG_CONFIGURATION: "wrong configuration",
    3: "cannot open its source",
    4: "no router",
}
"""What the exit statuses of ``zv`` mean; those of other programs have no common meaning."""

KILLED_S = 0.5
"""How long to wait for a process that was killed."""

MAX_LINE = 4096
"""Characters of a line of output that are shown as one; a longer one becomes several."""


class Child:
    """A node's process, started again when it dies, in a process group of its own.

    ``state`` is ``starting``, ``running``, ``running, no node`` (it runs, but announces no node),
    ``restarting in N s``, ``finished``, ``failed`` (not started again) or ``stopped`` (by ``zv
    up``, or for ``zv node stop``). ``ended_s`` is the monotonic time of its last end.

    Args:
        name: Name of the node.
        command_line: How it is started.
        restart: Whether to start it again when it dies.
        finishes: Whether exit status 0 means that its work is done, such as for a camera at the
            end of its file. Any other process with status 0 was stopped by someone else.
        required: Whether ``zv up`` ends when it has ended.
        say: Called with a line to show the user; from any thread.
        guard: Ends the group of a program when ``zv up`` is gone. None for a command of ``zv``,
            which watches its parent itself, and whose standard output is discarded.
    """

    def __init__(
        self,
        name: str,
        command_line: CommandLine,
        *,
        restart: bool = True,
        finishes: bool = False,
        required: bool = False,
        say: Callable[[str], None],
        guard: GroupGuard | None = None,
    ) -> None:
        self.name = name
        self.required = required
        self.state = "starting"
        self.pid: int | None = None
        self.exit_status: int | None = None
        self._command_line = command_line
        self._restart = restart
        self._finishes = finishes
        self._say = say
        self._guard = guard
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self._group: int | None = None
        self._lifeline: int | None = None
        self._has_run = False
        self._held = False
        self._kill_s = float("inf")
        self._started_s = 0.0
        self.ended_s = 0.0
        self._backoff = Backoff(FIRST_DELAY_S, LONGEST_DELAY_S)
        self._again_s: float | None = None

    def start(self) -> None:
        """Start the process, which also ends when ``zv up`` ends for any reason.

        A program that can no longer be executed counts as ended with status 127, as in a shell.
        """
        self.state, self.exit_status, self._again_s = "starting", None, None
        self._held, self._kill_s = False, float("inf")
        self._started_s = time.monotonic()
        try:
            self._process = self._started()
        except OSError as error:
            self._say(f"{self.name}: {self._command_line.words[0]}: {error.strerror}")
            self.exit_status = CANNOT_EXECUTE
            self._plan_restart(CANNOT_EXECUTE)
            return
        self.pid = self._group = self._process.pid
        if self._guard is not None:
            self._add_to(self._guard, self._group)
        output = self._process.stderr or self._process.stdout
        assert output is not None
        reader = threading.Thread(target=self._forward, args=(output,), daemon=True)
        reader.start()
        self._reader = reader

    def _add_to(self, guard: GroupGuard, group: int) -> None:
        try:
            guard.add(group)
        except OSError as error:  # such as too many processes; go on without a guard
            self._say(
                f"{self.name} would outlive a killed zv up: the process that would end it "
                f"cannot be started: {error.strerror}"
            )

    def _started(self) -> subprocess.Popen[str]:
        reading, writing = os.pipe()
        line, service = self._command_line, self._guard is None
        try:
            process = subprocess.Popen(  # noqa: S603 - what the launch file names
                line.words,
                env={
                    **line.environment,
                    lifeline.SUPERVISED_VARIABLE: lifeline.LAUNCHED,
                    **({lifeline.VARIABLE: str(reading)} if service else {}),
                },
                cwd=line.folder,
                pass_fds=(reading,) if service else (),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL if service else subprocess.PIPE,
                stderr=subprocess.PIPE if service else subprocess.STDOUT,
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
        return process

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    @property
    def ended(self) -> bool:
        """Whether the process has ended and will not be started again, by anybody."""
        return self.state in ("finished", "failed", "stopped") and not self._held

    @property
    def age_s(self) -> float:
        """Seconds since its start."""
        return time.monotonic() - self._started_s

    def mark_running(self, *, announced: bool = True) -> None:
        """Note that the process does its work, and whether it has announced a node."""
        if self.alive:
            self.state, self._has_run = "running" if announced else "running, no node", True

    def check(self) -> None:
        """Note whether the process has ended, and start it again when its delay is over."""
        if self._again_s is not None:
            left_s = self._again_s - time.monotonic()
            if left_s <= 0:
                self.start()
            else:
                self.state = f"restarting in {left_s:.0f} s"
        elif self.pid is not None and not self.alive:
            assert self._process is not None
            self.pid, self.exit_status = None, self._process.returncode
            self.ended_s = time.monotonic()
            self._end_group(time.monotonic())  # end the processes that it has started, too
            self._close_lifeline()
            self._plan_restart(self.exit_status)
        elif self.pid is not None and time.monotonic() > self._kill_s and self._group is not None:
            self._say(f"{self.name} did not end in time: killed")
            self._kill_s = float("inf")
            signal_group(self._group, signal.SIGKILL)

    def hold(self, deadline_s: float) -> None:
        """End the process until ``start``, by SIGKILL after a monotonic time; ``check`` goes on.

        This does not count as its end: ``zv up`` goes on, since it may be started again.
        """
        self.terminate()
        self._held, self._kill_s = True, deadline_s
        self._backoff.reset()
        if not self.alive:
            self.state = "stopped"

    def _plan_restart(self, status: int) -> None:
        if self._held:
            self.state = "stopped"
            self._say(f"{self.name} was stopped")
            return
        how = ended_how(status, MEANING if self._guard is None else {})
        if status == 0 and self._finishes:
            self.state = "finished"
            self._say(f"{self.name} has finished")
        # Wrong configuration counts as temporary if the process has run with the same flags before.
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

    def terminate(self, number: int = signal.SIGTERM) -> None:
        """Send a signal to end the process, and do not start it again; safe in a signal handler."""
        self._again_s = None
        if self._group is not None:
            signal_group(self._group, number)

    def finish(self, deadline_s: float) -> None:
        """Wait for the process to end until a monotonic time, then kill it."""
        if self._process is not None:
            try:
                self._process.wait(max(0.0, deadline_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                self._say(f"{self.name} did not end in time: killed")
                if self._group is not None:
                    signal_group(self._group, signal.SIGKILL)
                with suppress(subprocess.TimeoutExpired):  # a process of another user
                    self._process.wait(KILLED_S)
            self._end_group(deadline_s)
            if self._reader is not None:
                self._reader.join(0.2)
        self._close_lifeline()
        self.pid = None
        if self.state not in ("finished", "failed"):
            self.state = "stopped"

    def _end_group(self, deadline_s: float) -> None:
        """End the processes that the child has left behind in its group."""
        if self._group is not None:
            end_group(self._group, deadline_s)
            if self._guard is not None:
                self._guard.remove(self._group)
            self._group = None

    def _close_lifeline(self) -> None:
        if self._lifeline is not None:
            os.close(self._lifeline)
            self._lifeline = None

    def _forward(self, lines: IO[str]) -> None:
        with lines:
            while line := lines.readline(MAX_LINE):
                text = line.rstrip().removeprefix("zv: ")
                self._say(text if f"{self.name}: " in text else f"{self.name}: {text}")


def ended_how(status: int, meanings: Mapping[int, str] = MEANING) -> str:
    """Return how a process ended, by its exit status."""
    if status < 0:
        return f"died (signal {-status})"
    meaning = f" ({meanings[status]})" if status in meanings else ""
    return f"ended with status {status}{meaning}"
