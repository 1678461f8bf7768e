"""Memory that a loop frees is there for its next round."""

from __future__ import annotations

import platform
import sys

import pytest

from tests.support.processes import run_program

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


pytestmark = pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc", reason="only glibc has these options"
)


def printed(program: str, *arguments: str) -> int:
    return int(run_program([sys.executable, "-c", program, *arguments]).stdout)


def test_pages_that_were_freed_are_not_cleared_again():
    assert printed(PROGRAM, "kept") < ROUNDS
    assert printed(PROGRAM, "by default") > ROUNDS * PAGES


THREADS = 8
SHARED = f"""
import os, sys, threading
from zenoh_vision.host.allocator import keep_freed_memory

keep_freed_memory()
def resident():
    return int(open("/proc/self/statm").read().split()[1])
before, done = resident(), threading.Barrier({THREADS} + 1)
turn = threading.Lock()
def use():
    with turn:
        blocks = [bytearray({PAGES} * os.sysconf("SC_PAGESIZE")) for _ in range(3)]
        del blocks
    done.wait()  # only threads that live have an arena each
threads = [threading.Thread(target=use) for _ in range({THREADS})]
for thread in threads:
    thread.start()
done.wait()
print(resident() - before)
"""


def test_threads_share_the_memory_that_is_kept():
    assert printed(SHARED) < 2 * 3 * PAGES  # that of two threads; each would keep as much
