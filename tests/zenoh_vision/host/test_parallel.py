"""Parts of one piece of work on several threads: complete, in order, and never left running."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial

import pytest

from tests.support.processes import ROOT, environment
from tests.support.waiting import DEADLINE_S
from zenoh_vision.host.parallel import MAX_BY_ITSELF, Workers


@pytest.fixture
def workers() -> Iterator[Workers]:
    found = Workers()
    found.limit(3)
    yield found
    found.limit(1)  # ends the threads


def test_results_come_in_the_order_of_the_parts(workers):
    parts = [partial(int, f"{number}") for number in range(20)]
    for _ in range(50):
        assert workers.run(parts) == list(range(20))


def test_parts_run_at_the_same_time(workers):
    all_there = threading.Barrier(3, timeout=DEADLINE_S)
    assert sorted(workers.run([all_there.wait] * 3)) == [0, 1, 2]


def test_no_more_parts_run_at_the_same_time_than_are_allowed(workers):
    running, most, lock = 0, 0, threading.Lock()

    def part() -> None:
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        threading.Event().wait(0.002)
        with lock:
            running -= 1

    workers.run([part] * 30)
    assert 1 < most <= 3


def test_the_caller_does_what_no_thread_has_begun():
    workers = Workers()
    workers.limit(2)
    release, busy = threading.Event(), threading.Event()

    def occupy() -> int:
        busy.set()
        assert release.wait(DEADLINE_S)
        return threading.get_ident()

    other = threading.Thread(target=lambda: workers.run([threading.get_ident, occupy]))
    other.start()
    assert busy.wait(DEADLINE_S)
    mine = threading.get_ident()  # the only other thread is busy with another caller's part
    assert workers.run([threading.get_ident] * 4) == [mine] * 4
    release.set()
    other.join(DEADLINE_S)
    workers.limit(1)


@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_is_raised_when_no_part_runs_any_more(workers, failing):
    begun, ended = threading.Event(), threading.Event()

    def slow() -> None:
        begun.set()
        threading.Event().wait(0.1)
        ended.set()

    def fail() -> None:
        assert begun.wait(DEADLINE_S)
        raise ValueError("this part failed")

    parts = [fail, slow] if failing == 0 else [partial(begun.wait, DEADLINE_S), slow, fail]
    with pytest.raises(ValueError, match="this part failed"):
        workers.run(parts)
    assert ended.is_set()


def test_one_thread_is_the_callers_own(workers):
    workers.limit(1)
    assert workers.run([threading.get_ident] * 3) == [threading.get_ident()] * 3


def test_by_default_there_is_a_thread_for_each_processor_of_the_process_up_to_four():
    own = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    assert Workers().threads == min(own or 1, MAX_BY_ITSELF)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="Linux alone says where one runs")
@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs two processors")
def test_the_threads_keep_off_the_callers_processor(workers):
    one, *others = everywhere = sorted(os.sched_getaffinity(0))
    caller, meet = threading.get_ident(), threading.Barrier(3, timeout=DEADLINE_S)

    def look() -> set[int]:
        meet.wait()  # so that each part has a thread of its own
        return set() if threading.get_ident() == caller else os.sched_getaffinity(0)

    workers.run([look] * 3)  # starts the threads
    try:
        os.sched_setaffinity(0, {one})
        assert workers.run([look] * 3) == [set(), {*others}, {*others}]
    finally:
        os.sched_setaffinity(0, everywhere)


def test_a_thread_that_still_works_when_the_interpreter_ends_says_nothing():
    program = """
import threading, time
from zenoh_vision.host.parallel import Workers
workers = Workers()
workers.limit(2)
def work():
    while True:
        workers.run([int, int])
threading.Thread(target=work, daemon=True).start()
time.sleep(0.2)
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=ROOT,
        env=environment(),
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
