"""Runs one system: starts its programs, and measures ages, CPU time and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import psutil
from numpy.typing import NDArray

from benchmarks.peers.programs.measuring import RATE_HZ, WARM_UP
from benchmarks.system import cpu_s

START_S = 30.0
STOP_S = 3.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one run of a system measured.

    Attributes:
        ages_ms: Of each frame, from capture to decoded pixels, or to the result.
        cpu_ms: CPU time of camera and consumer for a frame.
        between_ms: CPU time of the router, or the master, for a frame.
        memory_mb: Proportional set size of all its processes at the end.
    """

    ages_ms: tuple[float, ...]
    cpu_ms: float
    between_ms: float
    memory_mb: float


class Failed(Exception):
    """A system did not deliver; the text says how far it came."""


class Programs:
    """The processes of one system; all are ended at the end."""

    def __init__(self) -> None:
        self._running: list[psutil.Popen] = []
        self._between: list[psutil.Popen] = []

    def start(
        self,
        *arguments: str,
        env: Mapping[str, str] | None = None,
        talks: bool = False,
        between: bool = False,
    ) -> psutil.Popen:
        """Start a program.

        Args:
            arguments: The program, and its arguments.
            env: Environment variables besides those of this process.
            talks: Its standard input and output are pipes.
            between: It is a router or master.
        """
        pipe = subprocess.PIPE if talks else subprocess.DEVNULL
        started = psutil.Popen(
            list(arguments),
            env={**os.environ, **(env or {})},
            stdin=pipe,
            stdout=pipe,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._running.append(started)
        if between:
            self._between.append(started)
        return started

    def python(
        self, module: str, *arguments: str, talks: bool = False, between: bool = False
    ) -> psutil.Popen:
        """Start a module with this Python."""
        program = (sys.executable, "-m", module, *arguments)
        return self.start(*program, talks=talks, between=between)

    def cpu_s(self) -> NDArray[np.float64]:
        """Return the CPU time so far of camera and consumer, and of what is between them."""
        spent = [0.0, 0.0]
        for each in self._running:
            spent[each in self._between] += cpu_s(each.pid)
        return np.array(spent)

    def memory_mb(self) -> float:
        """Return the memory of all processes; shared pages are counted once."""
        return sum(each.memory_full_info().pss for each in self._running) / 1e6

    def stop(self) -> None:
        """End all processes, the last started first."""
        for each in reversed(self._running):
            each.terminate()
        for each in reversed(self._running):
            try:
                each.wait(STOP_S)
            except psutil.TimeoutExpired:
                each.kill()
                each.wait()


@contextmanager
def programs() -> Iterator[Programs]:
    """Yield the processes of a system, which end with the block."""
    started = Programs()
    try:
        yield started
    finally:
        started.stop()


def measured(started: Programs, consumer: psutil.Popen, frames: int) -> Outcome:
    """Return what a consumer measures of so many frames, and what all programs cost meanwhile.

    Raises:
        Failed: The consumer did not get its frames in time.
    """
    longest_s = START_S + 3 * (WARM_UP + frames) / RATE_HZ
    watchdog = threading.Timer(longest_s, consumer.kill)
    watchdog.start()
    try:
        if consumer.stdout.readline().strip() != "begin":
            raise Failed(f"no frames beyond the warm-up in {longest_s:.0f} s")
        before_s = started.cpu_s()
        line = consumer.stdout.readline()
        cpu_s = started.cpu_s() - before_s
        if not line:
            raise Failed(f"fewer than {frames} frames in {longest_s:.0f} s")
        memory_mb = started.memory_mb()
    finally:
        watchdog.cancel()
    ages: Sequence[float] = json.loads(line)
    cpu_ms, between_ms = cpu_s / frames * 1e3
    return Outcome(tuple(ages), float(cpu_ms), float(between_ms), memory_mb)
