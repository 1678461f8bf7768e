"""`zv up` as a user types it: real processes, real signals, nothing left behind."""

import os
import signal
import socket
import time
from pathlib import Path

import psutil
import pytest
import zenoh

from common.session import Connection, open_session
from tests.integration.listening import Listener, open_client
from tests.integration.waiting import wait_until
from tests.processes import Program, free_endpoint

NODES = {"router", "camera_front", "tracker_front", "edge_front"}


def up(folder: Path, *arguments: str) -> Program:
    return Program(["-m", "services", "up", "--plain", *arguments], folder, "up")


def open_when_ready(endpoint: str) -> zenoh.Session:
    return open_session(Connection(connect=endpoint, timeout_s=20))


def children(program: Program) -> list[psutil.Process]:
    return psutil.Process(program.process.pid).children()


def running(processes: list[psutil.Process]) -> list[psutil.Process]:
    return [p for p in processes if p.is_running() and p.status() != psutil.STATUS_ZOMBIE]


def service_of(process: psutil.Process) -> str:
    return process.cmdline()[3]


def test_three_services_work_together_and_ctrl_c_ends_all_with_0_within_2_s(tmp_path):
    endpoint = free_endpoint()
    with up(tmp_path, "--listen", endpoint) as program:
        client = open_when_ready(endpoint)
        with client:
            Listener(client, "vision/front/centroid").wait_for(5, 20)
            Listener(client, "vision/front/edges/compressed").wait_for(5)
        lines = program.lines(r"(\w+) +running .*", 4)
        assert {line[1] for line in lines} == NODES
        started = children(program)
        assert sorted(map(service_of, started)) == ["camera", "edge", "router", "tracker"]
        begun_s = time.monotonic()
        program.process.send_signal(signal.SIGINT)
        assert program.process.wait(5) == 0
        assert time.monotonic() - begun_s < 2.0
        assert not running(started)
    assert f"router at {endpoint}" in program.complaints
    assert "vision/front/centroid" in program.complaints
    assert "Traceback" not in program.complaints


def test_nothing_is_left_behind_when_zv_up_itself_is_killed(tmp_path):
    with up(tmp_path, "--listen", free_endpoint()) as program:
        started = wait_until(lambda: len(children(program)) == 4 and children(program), 20)
        program.lines(r"camera_front +running +rate.*")
        program.process.kill()
        program.process.wait(5)
        wait_until(lambda: not running(started), 3)


def test_a_killed_tracker_is_started_again_and_that_is_said(tmp_path):
    endpoint = free_endpoint()
    with up(tmp_path, "--listen", endpoint) as program:
        with open_when_ready(endpoint) as client:
            centroids = Listener(client, "vision/front/centroid")
            centroids.wait_for(5, 20)
            (tracker,) = (p for p in children(program) if service_of(p) == "tracker")
            os.kill(tracker.pid, signal.SIGKILL)
            wait_until(lambda: "tracker_front died (signal 9)" in program.complaints)
            centroids.wait_for(5, 15, time.monotonic())
        assert "starting it again in 1 s" in program.complaints


def test_a_killed_router_is_started_again_and_all_flows_come_back(tmp_path):
    endpoint = free_endpoint()
    with up(tmp_path, "--listen", endpoint) as program, open_when_ready(endpoint) as client:
        centroids = Listener(client, "vision/front/centroid")
        centroids.wait_for(5, 20)
        (router,) = (p for p in children(program) if service_of(p) == "router")
        others = {p.pid for p in children(program)} - {router.pid}
        os.kill(router.pid, signal.SIGKILL)
        wait_until(lambda: "router died (signal 9)" in program.complaints)
        centroids.wait_for(5, 15, time.monotonic())
        assert others < {p.pid for p in children(program)}


def test_a_taken_port_is_explained_with_the_way_out_and_nothing_is_left(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        with up(tmp_path, "--listen", endpoint) as program:
            started = wait_until(lambda: children(program), 10)
            assert program.process.wait(15) == 2
            assert not running(started)
    assert "the port is taken" in program.complaints
    assert "--connect" in program.complaints


def test_connect_uses_the_router_that_is_there(tmp_path, router):
    with up(tmp_path, "--connect", router.endpoint) as program:
        with open_client(router.endpoint) as client:
            Listener(client, "vision/front/centroid").wait_for(5, 20)
        assert sorted(map(service_of, children(program))) == ["camera", "edge", "tracker"]
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(5) == 0


def test_a_file_that_was_played_is_not_played_again(tmp_path, router):
    folder = tmp_path / "pictures"
    folder.mkdir()
    import cv2
    import numpy as np

    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), np.full((48, 64, 3), 40 * number, np.uint8))
    launch = tmp_path / "played.toml"
    launch.write_text(
        f'[[node]]\nservice = "camera"\nsettings = {{ source = "{folder}" }}\n'
        '[[node]]\nservice = "tracker"\n'
    )
    with up(tmp_path, str(launch), "--connect", router.endpoint) as program:
        wait_until(lambda: "camera_front has finished" in program.complaints, 20)
        line = program.lines(r"camera_front +(.*)")[0]
        assert line[1].startswith("finished")
        assert [service_of(p) for p in running(children(program))] == ["tracker"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nosuch.toml"], "nosuch.toml: No such file"),
        (["--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:2"], "give one"),
        (["--listen", "7447"], "--listen = '7447' is not allowed"),
    ],
)
def test_wrong_use_ends_with_2_before_anything_is_started(tmp_path, arguments, said):
    with up(tmp_path, *arguments) as program:
        assert program.process.wait(15) == 2
    assert said in program.complaints
    assert "Traceback" not in program.complaints


def test_a_wrong_option_of_any_node_ends_with_2_before_anything_is_started(tmp_path):
    launch = tmp_path / "wrong.toml"
    launch.write_text(
        '[[node]]\nservice = "camera"\n[[node]]\nservice = "edge"\nsettings = { apertur = 3 }\n'
    )
    with up(tmp_path, str(launch)) as program:
        assert program.process.wait(15) == 2
    assert "did you mean 'aperture'" in program.complaints
    assert "router" not in program.complaints.replace(str(launch), "")
