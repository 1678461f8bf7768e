"""A process takes of the machine's processors what it was given."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tests.support.processes import run_program
from zenoh_vision.host.processors import processors_of

PROGRAM = """
import os, sys
{imported}
from zenoh_vision import ServiceSettings, run_service

def run(settings, connection):
    '''Print what this process may use.'''
    import cv2
    from zenoh_vision.host.parallel import workers
    numbers = cv2.getNumThreads(), workers.threads, os.getpriority(os.PRIO_PROCESS, 0)
    print(*numbers, sorted(os.sched_getaffinity(0)))
    threads = [int(name) for name in os.listdir("/proc/self/task")]
    assert len({{tuple(os.sched_getaffinity(each)) for each in threads}}) == 1
    assert len({{os.getpriority(os.PRIO_PROCESS, each) for each in threads}}) == 1

run_service(run, ServiceSettings)
"""
ALL = sorted(os.sched_getaffinity(0))
NICENESS = os.getpriority(os.PRIO_PROCESS, 0)


def run(folder: Path, *flags: object, imported: str = "", **variables: str):
    program = folder / "program.py"
    program.write_text(PROGRAM.format(imported=imported))
    return run_program([sys.executable, program, *flags], **variables)


@pytest.mark.parametrize(
    ("text", "processors"),
    [("0", {0}), ("0,2-3", {0, 2, 3}), ("3-3", {3}), ("7,7,6", {6, 7})],
)
def test_a_list_names_processors_and_ranges_of_them(text, processors):
    assert processors_of(text) == processors


@pytest.mark.parametrize("text", ["", "a", "1,", "-1", "2-", "0 1", "12345", "0,3-1"])
def test_any_other_text_is_no_list(text):
    with pytest.raises(ValueError, match=r"not a list of processors|3-1 ends before it begins"):
        processors_of(text)


HIGHEST = pytest.mark.skipif(NICENESS == 19, reason="these tests have the highest niceness already")


@pytest.mark.parametrize("imported", ["", "import cv2"], ids=["OpenCV later", "OpenCV before"])
def test_by_default_an_opencv_call_has_one_thread_and_nothing_else_is_limited(tmp_path, imported):
    assert run(tmp_path, imported=imported).stdout == f"1 {min(4, len(ALL))} {NICENESS} {ALL}\n"


def test_by_default_numpy_starts_no_threads_that_wait_in_a_busy_loop(tmp_path):
    threads = 'len(os.listdir("/proc/self/task"))'
    program = tmp_path / "program.py"
    program.write_text(f"""
import os
from zenoh_vision.host.processors import use_processors
use_processors(threads=1, nice=0, affinity=())
before = {threads}
import numpy
print({threads} - before, os.environ["OPENBLAS_NUM_THREADS"])
""")
    assert run_program([sys.executable, program]).stdout == "0 1\n"
    chosen = run_program([sys.executable, program], OPENBLAS_NUM_THREADS="2")
    assert chosen.stdout.endswith(" 2\n"), chosen.stderr


@HIGHEST
def test_threads_niceness_and_affinity_are_what_was_given(tmp_path):
    begun = "import threading; threading.Thread(target=threading.Event().wait, daemon=True).start()"
    nice = NICENESS + 1  # at 19, six workers beside it would let it wait for half a minute
    limits = ("--threads", 3, "--jpeg-threads", 5, "--nice", nice, "--affinity", ALL[-1])
    done = run(tmp_path, *limits, imported=begun)
    assert done.stdout == f"3 5 {nice} [{ALL[-1]}]\n", done.stderr
    limits = {"ZV_THREADS": "2", "ZV_NICE": f"{nice}", "ZV_AFFINITY": f"{ALL[0]}-{ALL[0]}"}
    by_environment = run(tmp_path, **limits)
    assert by_environment.stdout == f"2 1 {nice} [{ALL[0]}]\n", by_environment.stderr


def test_a_processor_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    done = run(tmp_path, "--affinity", "0,9000")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.endswith(
        "affinity = 0,9000 names a processor that this process may not use; allowed: of "
        f"{','.join(map(str, ALL))}\n"
    )


def test_what_is_no_list_of_processors_is_refused_at_its_source(tmp_path):
    done = run(tmp_path, ZV_AFFINITY="first")
    assert done.returncode == 2
    assert "environment: ZV_AFFINITY = 'first' is not allowed" in done.stderr
    assert "allowed: processors such as 0,2-3" in done.stderr
