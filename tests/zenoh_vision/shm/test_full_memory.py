"""Shared memory that becomes full is said, and ends no process."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.support.processes import ROOT, environment
from zenoh_vision.shm.machine import why_impossible

UNSHARE = ["unshare", "--map-root-user", "--mount"]
FULL = "/dev/shm is full"


def allowed() -> bool:
    try:
        return subprocess.run([*UNSHARE, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.skipif(bool(why_impossible()), reason=why_impossible() or "-")
@pytest.mark.skipif(not allowed(), reason="needs a mount of its own: unshare is not allowed here")
@pytest.mark.parametrize(
    ("width", "height"),
    [(320, 240), (285, 8)],
    ids=["large", "so small that several pieces of memory lie in a page"],
)
def test_a_full_memory_is_an_error_before_anything_is_written_to_it(width, height):
    program = [*UNSHARE, sys.executable, "-m", "tests.support.programs.full_memory"]
    program += [str(width), str(height)]
    done = subprocess.run(
        program, capture_output=True, text=True, timeout=60, cwd=ROOT, env=environment()
    )
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert json.loads(done.stdout) == {
        "a frame larger than the memory": FULL,
        "while there is room": "",
        "when it has become full": FULL,
        "views stay": "",
        "when there is room again": "",
    }
