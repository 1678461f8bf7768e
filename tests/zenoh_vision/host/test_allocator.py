"""Memory that a loop frees is there for its next round."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

ROUNDS, PAGES = 50, 1000
PROGRAM = f"""
import resource, sys
from zenoh_vision.host.allocator import keep_freed_memory

if sys.argv[1] == "kept":
    keep_freed_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for number in range({ROUNDS} + 3):
    if number == 3:
        before = faults()
    blocks = [bytearray({PAGES} * resource.getpagesize()) for _ in range(3)]
    del blocks
print(faults() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has these options")
def test_pages_that_were_freed_are_not_cleared_again():
    def faults(how: str) -> int:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, how], capture_output=True, text=True, check=True
        )
        return int(done.stdout)

    assert faults("kept") < ROUNDS
    assert faults("by default") > ROUNDS * PAGES
