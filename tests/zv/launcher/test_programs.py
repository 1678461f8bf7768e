"""Programs of the user's own as processes: what they learn, and that nothing of them is left."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from tests.support.waiting import wait_until
from zenoh_vision.host import group_guard
from zenoh_vision.host.group_guard import GroupGuard
from zenoh_vision.transport.connection import Connection
from zv.launcher.child import Child
from zv.launcher.command_line import program_command_line
from zv.status.process_usage import ProcessUsage

Start = Callable[..., Child]


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def start(tmp_path: Path, said: list[str]) -> Iterator[Start]:
    """Starts a program that ``sh`` runs as node ``mine_front``."""
    guard = GroupGuard(1.5)
    started = []

    def begin(script: str, **variables: str) -> Child:
        connection = Connection("tcp/127.0.0.1:7000", "robot1", "tls.json5")
        words = ["/bin/sh", "-c", script]
        line = program_command_line("mine_front", words, variables, tmp_path, connection)
        child = Child("mine_front", line, say=said.append, finishes=True, guard=guard)
        started.append(child)
        child.start()
        return child

    yield begin
    for child in started:
        child.terminate()
        child.finish(time.monotonic() + 1)
    guard.close()


def until_ended(child: Child) -> None:
    wait_until(lambda: child.check() or child.exit_status is not None)


def alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def pids(said: list[str]) -> list[int]:
    """Return the process ids that a program has printed."""
    return [int(line.rpartition(" ")[2]) for line in said if line.startswith("mine_front: pid ")]


def test_a_program_learns_router_namespace_and_its_name_and_where_it_runs(
    start, said, tmp_path, monkeypatch
):
    monkeypatch.setenv("ZV_TIMEOUT", "3")  # of zv up itself
    script = (
        "echo $ZV_CONNECT $ZV_NAMESPACE $ZV_NODE $ZV_TIMEOUT.; pwd; echo $MINE $ZV_ZENOH_CONFIG"
    )
    until_ended(start(script, MINE="my own"))
    wait_until(lambda: len(said) >= 4)
    assert sorted(said) == sorted(
        [
            "mine_front: tcp/127.0.0.1:7000 robot1 mine_front .",
            f"mine_front: {tmp_path}",
            f"mine_front: my own {Path('tls.json5').absolute()}",
            "mine_front has finished",
        ]
    )


def test_what_a_program_prints_is_shown_with_its_name_on_either_stream(start, said):
    until_ended(start("echo out; echo err >&2; head -c 5000 /dev/zero | tr '\\0' x"))
    wait_until(lambda: len(said) == 5)
    lines = sorted(line.removeprefix("mine_front: ") for line in said)
    assert lines == ["err", "mine_front has finished", "out", "x" * 904, "x" * 4096]


def test_a_program_runs_and_ends_even_if_its_guard_cannot_be_started(start, said, monkeypatch):
    monkeypatch.setattr(group_guard.sys, "executable", "/nonexistent")
    child = start("echo pid $$; sleep 60")
    (warning,) = [line for line in said if "would outlive" in line]
    assert warning.startswith("mine_front would outlive a killed zv up: ")
    assert warning.endswith("cannot be started: No such file or directory")
    wait_until(lambda: pids(said))
    child.terminate()
    child.finish(time.monotonic() + 1)
    assert (child.state, alive(pids(said)[0])) == ("stopped", False)


def test_the_status_of_a_program_means_nothing_but_0_and_2(start, said):
    child = start("exit 3")
    until_ended(child)
    assert said == ["mine_front ended with status 3, starting again in 1 s"]
    child = start("exit 2")
    until_ended(child)
    assert (said[-1], child.state) == (
        "mine_front ended with status 2, not starting again",
        "failed",
    )
    child = start("exit 0")
    until_ended(child)
    assert child.state == "finished"


def test_a_program_that_ignores_the_request_is_killed_with_its_children(start, said):
    child = start("trap '' TERM; sleep 60 & echo pid $!; echo pid $$; wait; sleep 60")
    wait_until(lambda: len(pids(said)) == 2)
    child.terminate()
    child.finish(time.monotonic() + 0.2)
    wait_until(lambda: not any(map(alive, pids(said))))
    assert "mine_front did not end in time: killed" in said
    assert child.state == "stopped"


def test_a_child_that_outlives_its_program_at_the_end_is_killed(start, said):
    child = start("trap 'exit 0' TERM; (trap '' TERM; sleep 60) & echo pid $!; wait")
    wait_until(lambda: pids(said))
    child.terminate()
    child.finish(time.monotonic() + 0.3)
    wait_until(lambda: not any(map(alive, pids(said))))


def test_what_a_program_has_started_ends_when_the_program_dies(start, said):
    child = start("sleep 60 & echo pid $!; wait")
    wait_until(lambda: pids(said))
    os.kill(child.pid, signal.SIGKILL)
    until_ended(child)
    wait_until(lambda: not any(map(alive, pids(said))))
    assert "mine_front died (signal 9), starting again in 1 s" in said


def test_a_program_that_is_gone_when_it_is_started_again_is_tried_later(tmp_path, said):
    line = program_command_line("x", [str(tmp_path / "gone")], {}, tmp_path, Connection())
    child = Child("x", line, say=said.append, guard=GroupGuard(1.5))
    child.start()
    assert said == [
        f"x: {tmp_path / 'gone'}: No such file or directory",
        "x ended with status 127, starting again in 1 s",
    ]


def test_cpu_and_memory_include_what_a_program_has_started(start, said):
    hold = "import time; x = bytearray(80_000_000); print('pid 1', flush=True); time.sleep(60)"
    child = start(f'python3 -c "{hold}" & wait')
    wait_until(lambda: pids(said))
    usage = ProcessUsage()
    usage.begin(child.pid)
    assert usage.read(child.pid)[1] < 10  # MB: the shell alone
    assert usage.read(child.pid, descendants=True)[1] > 80


PARENT = """
import sys, time
from pathlib import Path
from zenoh_vision.transport.connection import Connection
from zv.launcher.child import Child
from zv.launcher.command_line import program_command_line
from zenoh_vision.host.group_guard import GroupGuard

def print_line(line):
    print(line, flush=True)

script = "trap '' TERM; sleep 60 & echo pid $!; echo pid $$; wait; sleep 60"
line = program_command_line("mine_front", ["/bin/sh", "-c", script], {}, Path("/"), Connection())
child = Child("mine_front", line, say=print_line, guard=GroupGuard(1.5))
child.start()
time.sleep(60)
"""


def test_when_zv_up_is_killed_a_program_ends_with_its_children():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        said = [parent.stdout.readline().rstrip() for _ in range(2)]
        descendants = psutil.Process(parent.pid).children(recursive=True)
        assert set(pids(said)) < {each.pid for each in descendants}
        parent.kill()
        parent.wait()
    wait_until(lambda: not any(alive(each.pid) for each in descendants))  # the guard itself, too
