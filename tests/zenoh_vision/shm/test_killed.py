"""Either side may be killed at any time: the other goes on, and nothing is left over."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

from tests.support.processes import ROOT, environment
from tests.support.shm_reading import Reading
from tests.support.waiting import wait_until

pytest.importorskip("iceoryx2")

from zenoh_vision.shm.machine import MEMORY
from zenoh_vision.shm.reader import FrameReader
from zenoh_vision.shm.writer import FrameWriter

TIMES = 3


class Side:
    """One side of shared memory in a process of its own, until it is killed."""

    def __init__(self, side: str, offer: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.support.programs.shm_end", side, offer],
            stdout=subprocess.PIPE,
            cwd=ROOT,
            env=environment(),
        )
        assert self._process.stdout is not None
        self._output = self._process.stdout
        self.pid = self._process.pid

    def goes_on(self, frames: int = 3) -> None:
        """Wait until it has written or received more frames."""
        for _ in range(frames):
            assert self._output.readline(), f"it ended: {self._process.wait()}"

    def kill(self) -> list[Path]:
        """Kill it, and return the locks of iceoryx2's nodes that it held."""
        held = [descriptor.readlink() for descriptor in Path(f"/proc/{self.pid}/fd").iterdir()]
        os.kill(self.pid, signal.SIGKILL)
        self._process.wait()
        self._output.close()
        locks = [path for path in held if path.name.endswith(".node_monitor_owner_lock")]
        assert locks
        return locks


def test_a_killed_reader_leaves_the_writer_going_and_a_new_one_receives():
    offer = f"kill{uuid.uuid4().hex[:8]}"
    writer, locks = Side("write", offer), []
    try:
        writer.goes_on()
        for _ in range(TIMES):
            reader = Side("read", offer)
            reader.goes_on()
            locks += reader.kill()
            writer.goes_on()
    finally:
        locks += writer.kill()
    assert_all_is_removed(offer, locks)


def test_a_killed_writer_leaves_views_intact_and_its_files_are_removed_by_the_next():
    locks = []
    for _ in range(TIMES):
        offer = f"kill{uuid.uuid4().hex[:8]}"
        side = Side("write", offer)
        side.goes_on()
        arrived = []
        reader = Reading(offer, arrived.append)
        wait_until(lambda arrived=arrived: arrived)
        locks += side.kill()
        assert set(bytes(arrived[-1].payload)) == {7}
        reader.close()
    assert_all_is_removed(offer, locks)


def assert_all_is_removed(offer: str, locks: list[Path]) -> None:
    """Let another offer begin and end, then look for what is left of dead ones."""
    next_offer = f"next{uuid.uuid4().hex[:8]}"
    writer = FrameWriter(next_offer)
    FrameReader(next_offer, "vision/front/image").__exit__()
    writer.close()
    assert not [path for path in MEMORY.rglob("*.bell") if offer in path.name]
    # Another process may have begun to remove them, and be at it.
    wait_until(lambda: not any(lock.exists() for lock in locks), 10)
