"""A tool that is told to stop ends although nobody reads its output."""

from __future__ import annotations

import fcntl
import signal
import subprocess
import sys
import termios
from collections.abc import Iterator

import pytest

from tests.support.processes import environment
from tests.support.waiting import DEADLINE_S, wait_until

LINES = 100_000
FULL = 65_500
"""Bytes in a pipe of 65,536 to which no line can be added, or only a few."""

PROGRAM = f"""
from zenoh_vision.transport.connection import Connection
from zv.tools.shared.session import ToolSession

with ToolSession(Connection("ENDPOINT", timeout_s=20)) as session:
    for _ in range({LINES}):
        print("line", flush=True)
    raise SystemExit(0 if session.stopping else 1)
"""


def unread_bytes(process: subprocess.Popen[bytes]) -> int:
    assert process.stdout is not None
    found = fcntl.ioctl(process.stdout, termios.FIONREAD, bytes(4))
    return int.from_bytes(found, sys.byteorder)


@pytest.fixture
def blocked(router) -> Iterator[subprocess.Popen[bytes]]:
    """Start a tool that waits for the reader of its output."""
    program = PROGRAM.replace("ENDPOINT", router.endpoint)
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, env=environment()
    ) as process:
        wait_until(lambda: unread_bytes(process) > FULL)
        yield process
        process.kill()


def test_a_tool_ends_although_nobody_reads_its_output(blocked: subprocess.Popen[bytes]):
    blocked.send_signal(signal.SIGINT)
    assert blocked.wait(DEADLINE_S) == 0


def test_a_reader_that_is_only_slow_gets_everything(blocked: subprocess.Popen[bytes]):
    blocked.send_signal(signal.SIGTERM)
    assert blocked.stdout is not None
    assert blocked.stdout.read() == b"line\n" * LINES
    assert blocked.wait(DEADLINE_S) == 0
