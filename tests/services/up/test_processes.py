"""A child process over its lives, with real processes: here `zv router` and wrong commands."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from services.up import processes
from services.up.processes import Child
from tests.integration.waiting import wait_until
from tests.processes import free_endpoint


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def router(said: list[str]) -> Iterator[Child]:
    child = Child("router", ["router", "--listen", free_endpoint()], restart=True, say=said.append)
    child.start()
    yield child
    child.terminate()
    child.finish(time.monotonic() + 5)


def listens(said: list[str]) -> bool:
    return any("router listens on" in line for line in said)


def test_a_process_that_is_killed_is_started_again_after_a_delay_and_that_is_said(
    router, said, monkeypatch
):
    wait_until(lambda: listens(said))
    first = router.pid
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: router.look_after() or "router died" in " ".join(said))
    assert "router died (signal 9), starting it again in 1 s" in said
    assert not router.over
    wait_until(lambda: router.look_after() or router.pid not in (None, first))
    assert router.state == "running"


def test_the_delay_doubles_up_to_half_a_minute(said, monkeypatch):
    monkeypatch.setattr(processes, "FIRST_DELAY_S", 0.02)
    child = Child("x", ["camera", "--source", "/nonexistent"], restart=True, say=said.append)
    child._delay_s = 8.0
    delays = []
    for _ in range(4):
        child.start()
        wait_until(lambda: child.look_after() or child.exit_status is not None, 20)
        delays.append([line for line in said if "starting it again" in line][-1])
        child._again_s = None
    assert [line.rsplit(" ", 2)[1] for line in delays] == ["8", "16", "30", "30"]


def test_a_source_that_cannot_be_opened_is_tried_again_and_its_words_are_passed_on(said):
    child = Child("camera_x", ["camera", "--source", "/nonexistent"], restart=True, say=said.append)
    child.start()
    wait_until(lambda: child.look_after() or child.exit_status is not None)
    assert child.exit_status == 3
    assert not child.over
    wait_until(lambda: any("/nonexistent: no such file" in line for line in said))
    assert all("camera_x" in line for line in said)
    child.finish(time.monotonic())


def test_a_wrong_configuration_is_not_started_again(said):
    child = Child("edge_x", ["edge", "--low", "9", "--high", "1"], restart=True, say=said.append)
    child.start()
    wait_until(lambda: child.look_after() or child.exit_status is not None)
    assert (child.exit_status, child.state, child.over) == (2, "failed", True)


def test_a_node_that_is_not_to_be_restarted_stays_down(said):
    child = Child("camera_x", ["camera", "--source", "/none"], restart=False, say=said.append)
    child.start()
    wait_until(lambda: child.look_after() or child.exit_status is not None)
    assert (child.state, child.over) == ("failed", True)


def test_a_process_that_ignores_the_request_to_end_is_killed(router, said):
    wait_until(lambda: listens(said))
    pid = router.pid
    os.kill(pid, signal.SIGSTOP)
    router.terminate()
    router.finish(time.monotonic() + 0.2)
    assert not psutil.pid_exists(pid)
    assert "router did not end in time: killed" in said


def test_no_descriptor_is_left_after_the_end(said, tmp_path: Path):
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        child = Child("x", ["router", "--listen", "nonsense"], restart=False, say=said.append)
        child.start()
        wait_until(lambda child=child: child.look_after() or child.exit_status is not None)
        child.finish(time.monotonic() + 1)
    assert len(os.listdir("/proc/self/fd")) == before
