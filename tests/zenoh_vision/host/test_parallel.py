"""Parts of one piece of work on several threads: complete, in order, and never left running."""

from __future__ import annotations

import gc
import os
import sys
import threading
import weakref
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import suppress
from functools import partial

import numpy as np
import pytest

from tests.support.processes import run_program
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.host import parallel
from zenoh_vision.host.parallel import MAX_BY_DEFAULT, MOST_WAITING, Workers


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
    running, most, lock, all_there = 0, 0, threading.Lock(), threading.Barrier(3)

    def part() -> None:
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        all_there.wait(DEADLINE_S)
        with lock:
            running -= 1

    workers.run([part] * 30)
    assert most == 3


@pytest.fixture
def occupied() -> Iterator[Workers]:
    """Workers whose only thread, and another caller, are busy with that caller's parts."""
    workers = Workers()
    workers.limit(2)
    release, busy = threading.Event(), threading.Barrier(3, timeout=DEADLINE_S)

    def part() -> None:
        busy.wait()
        release.wait(DEADLINE_S)

    other = threading.Thread(target=workers.run, args=[[part] * 2])
    other.start()
    busy.wait()
    yield workers
    release.set()
    other.join(DEADLINE_S)
    workers.limit(1)


def test_the_caller_does_what_no_thread_has_begun(occupied):
    assert occupied.run([threading.get_ident] * 4) == [threading.get_ident()] * 4


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

    parts = [fail, slow] if failing == 0 else [partial(begun.wait, DEADLINE_S), fail, slow]
    with pytest.raises(ValueError, match="this part failed"):
        workers.run(parts)
    assert ended.is_set()


def test_an_error_leaves_nothing_in_memory(workers):
    class Memory:
        """Stands for a picture."""

    def fail(_memory: Memory) -> None:
        raise ValueError("this part failed")

    gc.disable()
    try:
        memory = Memory()
        freed = weakref.ref(memory)
        with suppress(ValueError):
            workers.run([partial(fail, memory)] * 3)
        del memory
        wait_until(lambda: freed() is None)  # another thread may still be leaving the part
    finally:
        gc.enable()


def test_what_the_caller_did_is_not_kept_for_the_threads_that_came_too_late(occupied):
    memory = np.zeros(8)
    freed = weakref.ref(memory)
    occupied.run([partial(len, memory)] * 3)
    del memory
    assert freed() is None


def test_parts_that_the_caller_is_faster_with_do_not_pile_up(occupied):
    for _ in range(5000):
        occupied.run([lambda: None] * 4)
    assert len([each for each in gc.get_objects() if isinstance(each, Future)]) < 2 * MOST_WAITING


def test_the_limit_may_change_while_parts_run(workers):
    for count in (1, 2, 0, 3, 1):
        meanwhile = partial(workers.limit, count)
        assert workers.run([int, meanwhile, int, int]) == [0, None, 0, 0]


def test_threads_that_cannot_be_started_are_done_without(workers, monkeypatch):
    def no_more(_thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", no_more)
    caller = threading.get_ident()
    assert workers.run([threading.get_ident] * 3) == [caller] * 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forked processes")
def test_a_forked_process_has_threads_of_its_own():
    program = """
import os, threading
from zenoh_vision.host.parallel import workers
workers.limit(2)
meet = threading.Barrier(2, timeout=20)
workers.run([meet.wait] * 2)
if not os.fork():
    workers.run([meet.wait] * 2)
    os._exit(7)
print(os.waitstatus_to_exitcode(os.wait()[1]))
"""
    assert output_of(program) == "7\n"


def test_one_thread_is_the_callers_own(workers):
    workers.limit(1)
    assert workers.run([threading.get_ident] * 3) == [threading.get_ident()] * 3


def test_by_default_there_is_a_thread_for_each_processor_of_the_process_up_to_four():
    own = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    assert Workers().threads == min(own or 1, MAX_BY_DEFAULT)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="Linux alone says where one runs")
@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs two processors")
def test_the_threads_wake_up_on_other_processors_than_the_callers_and_are_then_free(workers):
    one, two, *_ = everywhere = sorted(os.sched_getaffinity(0))
    caller, meet = threading.get_ident(), threading.Barrier(3, timeout=DEADLINE_S)
    bound: list[tuple[int, set[int]]] = []

    def look() -> set[int]:
        meet.wait()  # so that each part has a thread of its own
        return {one} if threading.get_ident() == caller else os.sched_getaffinity(0)

    workers.run([look] * 3)  # starts the threads
    set_affinity = os.sched_setaffinity

    def note(thread: int, processors: set[int]) -> None:
        bound.append((thread, processors))
        set_affinity(thread, processors)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(parallel, "_current_processor", lambda: one)
        patched.setattr(os, "sched_setaffinity", note)
        assert workers.run([look] * 3) == [{one}, {*everywhere}, {*everywhere}]
    others = {*everywhere} - {one}
    assert [processors for thread, processors in bound if thread] == [others, others]
    try:
        set_affinity(0, {two})  # as by taskset; the threads follow
        assert workers.run([look] * 3)[1:] == [{*everywhere}, {*everywhere}]
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(parallel, "_current_processor", lambda: one)
            assert workers.run([look] * 3)[1:] == [{two}, {two}]
    finally:
        set_affinity(0, everywhere)


def output_of(program: str) -> str:
    done = run_program([sys.executable, "-c", program])
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_a_thread_that_still_works_when_the_interpreter_ends_says_nothing():
    program = """
import threading, time
from zenoh_vision.host.parallel import workers
workers.limit(2)
def work():
    while True:
        workers.run([int, int, int])
threading.Thread(target=work, daemon=True).start()
time.sleep(0.2)
"""
    assert output_of(program) == ""
