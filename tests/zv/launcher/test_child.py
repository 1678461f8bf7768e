"""A child process over its lives, with real processes: here `zv router` and wrong commands."""

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from tests.support.routing import free_endpoint
from tests.support.waiting import wait_until
from zenoh_vision.host.backoff import Backoff
from zenoh_vision.transport.connection import Connection
from zv.launcher import child as child_module
from zv.launcher.child import LONGEST_DELAY_S, Child
from zv.launcher.command_line import program_command_line, zv_command_line


def service_child(name: str, arguments: list[str], **options) -> Child:
    return Child(name, zv_command_line(arguments), **options)


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def router(said: list[str]) -> Iterator[Child]:
    child = service_child("router", ["router", "--listen", free_endpoint()], say=said.append)
    child.start()
    yield child
    child.terminate()
    child.finish(time.monotonic() + 5)


def listens(said: list[str]) -> bool:
    return any("router listens on" in line for line in said)


def test_a_killed_process_is_started_again_after_a_delay_and_reported(router, said, monkeypatch):
    wait_until(lambda: listens(said))
    first = router.pid
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: router.check() or "router died" in " ".join(said))
    assert router.state == "restarting in 1 s"  # as it was planned: nothing is checked meanwhile
    assert "router died (signal 9), starting again in 1 s" in said
    wait_until(lambda: router.check() or router.pid not in (None, first))
    assert router.state == "starting"
    router.mark_running()
    assert router.state == "running"


def test_the_delay_doubles_up_to_half_a_minute(said, tmp_path, monkeypatch):
    monkeypatch.setattr(child_module, "FIRST_DELAY_S", 0.02)
    line = program_command_line("x", ["/bin/sh", "-c", "exit 3"], {}, tmp_path, Connection())
    child = Child("x", line, say=said.append)
    child._backoff = Backoff(8.0, LONGEST_DELAY_S)
    delays = []
    for _ in range(4):
        child.start()
        wait_until(lambda: child.check() or child.exit_status is not None)
        delays.append([line for line in said if "starting again" in line][-1])
        child._again_s = None
    assert [line.rsplit(" ", 2)[1] for line in delays] == ["8", "16", "30", "30"]


def test_a_source_that_cannot_be_opened_is_tried_again_and_its_words_are_passed_on(said):
    child = service_child("camera_x", ["camera", "--source", "/nonexistent"], say=said.append)
    child.start()
    wait_until(lambda: child.check() or child.exit_status is not None)
    assert child.exit_status == 3
    assert child.state.startswith("restarting in ")
    wait_until(lambda: any("/nonexistent: no such file" in line for line in said))
    assert all("camera_x" in line for line in said)
    child.finish(time.monotonic())


def test_a_wrong_configuration_is_not_started_again(said):
    child = service_child("edge_x", ["edge", "--low", "9", "--high", "1"], say=said.append)
    child.start()
    wait_until(lambda: child.check() or child.exit_status is not None)
    assert (child.exit_status, child.state) == (2, "failed")
    assert said[-1] == "edge_x ended with status 2 (wrong configuration), not starting again"


def test_a_node_that_does_not_find_the_name_of_its_router_is_started_again(said):
    words = ["edge", "--connect", "tcp/router.invalid:7447", "--timeout", "1s"]
    child = service_child("edge_x", words, say=said.append)
    child.start()
    wait_until(lambda: child.check() or child.exit_status is not None)
    assert child.state.startswith("restarting in ")
    wait_until(lambda: any("router.invalid is not known here" in line for line in said))
    child.finish(time.monotonic())


def test_a_node_that_is_not_to_be_restarted_stays_down(said):
    child = service_child(
        "camera_x", ["camera", "--source", "/none"], restart=False, say=said.append
    )
    child.start()
    wait_until(lambda: child.check() or child.exit_status is not None)
    assert child.state == "failed"


def test_a_process_that_ignores_the_request_to_end_is_killed(router, said):
    wait_until(lambda: listens(said))
    pid = router.pid
    os.kill(pid, signal.SIGSTOP)
    router.terminate()
    router.finish(time.monotonic() + 0.2)
    assert not psutil.pid_exists(pid)
    assert "router did not end in time: killed" in said


def test_a_router_that_was_told_to_end_by_someone_else_is_started_again(router, said):
    wait_until(lambda: listens(said))
    os.kill(router.pid, signal.SIGTERM)
    wait_until(lambda: router.check() or router.exit_status is not None)
    assert (router.exit_status, router.state) == (0, "restarting in 1 s")
    assert said[-1] == "router ended with status 0, starting again in 1 s"


def test_a_camera_that_ends_with_0_has_finished_and_stays_down(said):
    child = service_child(
        "camera_x", ["--help"], finishes=True, say=said.append
    )  # ends with 0, too
    child.start()
    wait_until(lambda: child.check() or child.exit_status is not None)
    assert (child.exit_status, child.state) == (0, "finished")
    assert said == ["camera_x has finished"]


def test_a_router_whose_port_was_taken_while_it_was_down_is_started_again(said, monkeypatch):
    monkeypatch.setattr(child_module, "FIRST_DELAY_S", 0.0)
    endpoint = free_endpoint()
    child = service_child("router", ["router", "--listen", endpoint], say=said.append)
    child.start()
    wait_until(lambda: listens(said))
    child.mark_running()
    os.kill(child.pid, signal.SIGKILL)
    wait_until(lambda: not child.alive)
    with socket.create_server(("127.0.0.1", int(endpoint.rsplit(":", 1)[1]))):
        wait_until(lambda: child.check() or child.exit_status == 2)
    assert child.state.startswith("restarting in ")
    child.finish(time.monotonic())


def test_a_process_that_ran_for_long_restarts_with_the_first_delay(said, monkeypatch):
    monkeypatch.setattr(child_module, "STEADY_S", 0.0)
    child = service_child("x", ["camera", "--source", "/nonexistent"], say=said.append)
    assert [child._backoff.next_delay_s() for _ in range(4)] == [1, 2, 4, 8]
    child.start()
    wait_until(lambda: child.check() or child.exit_status is not None)
    assert child.state == "restarting in 1 s"


def test_a_process_that_waits_for_its_restart_is_not_started_after_terminate(said):
    child = service_child("x", ["camera", "--source", "/nonexistent"], say=said.append)
    child.start()
    wait_until(lambda: child.check() or child.state.startswith("restarting"))
    child.terminate()
    child.finish(time.monotonic())
    child.check()
    assert (child.state, child.pid) == ("stopped", None)


def test_a_folder_named_services_where_the_user_is_does_no_harm(said, tmp_path, monkeypatch):
    (tmp_path / "zv").mkdir()
    (tmp_path / "zv" / "__init__.py").write_text("raise SystemExit(77)")
    monkeypatch.chdir(tmp_path)
    child = service_child("router", ["router", "--listen", free_endpoint()], say=said.append)
    child.start()
    wait_until(lambda: listens(said) or not child.alive)
    assert child.alive, said
    child.terminate()
    child.finish(time.monotonic() + 2)


def test_a_terminals_ctrl_c_does_not_reach_a_child_so_that_nodes_end_before_their_router(router):
    assert os.getsid(router.pid) == router.pid


def test_what_zv_up_has_resolved_reaches_a_child_only_as_its_flags(monkeypatch):
    for name in ("ZV_CONNECT", "ZV_NAMESPACE", "ZV_ZENOH_CONFIG", "ZV_TIMEOUT", "ZV_EDGE_LOW"):
        monkeypatch.setenv(name, "1")
    environment = zv_command_line([]).environment
    assert {name for name in environment if name.startswith("ZV_")} == {"ZV_EDGE_LOW"}


def test_no_descriptor_is_left_after_the_end(said, tmp_path: Path):
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        child = service_child(
            "x", ["router", "--listen", "nonsense"], restart=False, say=said.append
        )
        child.start()
        wait_until(lambda child=child: child.check() or child.exit_status is not None)
        child.finish(time.monotonic() + 1)
    wait_until(lambda: len(os.listdir("/proc/self/fd")) <= before)  # others may close some, too
