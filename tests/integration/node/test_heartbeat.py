"""The file of a container's health check tells the truth of each service."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import psutil
import pytest
import zenoh

from tests.integration.conftest import QUICK_ZV, some_services
from tests.support.fork_server import ZV
from tests.support.listening import Listener, wait_for_nodes
from tests.support.processes import Program
from tests.support.publishing import PlainCamera
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.health.node_state import NodeState, S
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zv.launcher.child import Child
from zv.launcher.supervisor import failure_of

SMALL = ("--width", 320, "--height", 240)
STUCK_S = 1.0
"""Instead of the 5 s of health.py, where the node is in the process of the tests."""


@pytest.fixture
def health(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file; programs that are started in the test get it by their environment."""
    file = tmp_path / "health"
    monkeypatch.setattr(
        "tests.support.processes.environment",
        lambda: {
            **os.environ,
            "PYTHONPATH": os.getcwd(),
            "ZV_HEALTH_FILE": str(file),
            "ZV_VIEWER_PORT": "0",  # somebody may use the default one
        },
    )
    return file


def says(file: Path) -> str:
    return file.read_text() if file.exists() else ""


def fresh(file: Path) -> bool:
    """Tell whether it is written anew: the file found now is removed, and one comes."""
    file.unlink()
    return wait_until(lambda: says(file) == "ok\n")


def test_a_node_that_waits_for_a_router_is_healthy_and_ends_on_a_signal(tmp_path, health):
    router = Router(tmp_path)  # never started
    with some_services(router.endpoint, tmp_path) as start:
        start("tracker")
        wait_until(lambda: says(health) == "ok\n")
        assert fresh(health)


def test_a_node_without_input_is_healthy_however_long(router, health, monkeypatch):
    monkeypatch.setenv("ZV_HEALTH_FILE", str(health))
    monkeypatch.setattr("zenoh_vision.health.health.STUCK_S", STUCK_S)
    with Node("idle", connection=Connection(router.endpoint, timeout_s=20)) as node:
        worker = threading.Thread(target=lambda: list(node.frames()))
        worker.start()
        try:
            wait_until(lambda: says(health) == "ok\n")
            quiet_s = time.monotonic()
            while time.monotonic() - quiet_s < STUCK_S + 1.5:
                assert fresh(health)
        finally:
            node.stop()
            worker.join(5)


def test_a_camera_whose_source_is_gone_is_in_trouble_until_pictures_are_back(
    router, client, quick_service, health
):
    # Trouble ends with the next opening's first picture, after --reopen-min. It has to last for
    # some beats, or they may fall beside it in every one of its turns.
    faults = ("--faults", "stall@30+999999", "--stall-after", 1, "--reopen-min", 1)
    quick_service("camera", *SMALL, *faults)
    wait_until(lambda: says(health) == "ok\n")
    wait_until(lambda: says(health).startswith("trouble: no picture for 1 s"))
    wait_until(lambda: says(health) == "ok\n")  # opened again, in a new epoch


def test_a_loop_that_is_stuck_in_a_frame_is_trouble_and_an_error(
    router, client, tmp_path, monkeypatch
):
    health = tmp_path / "health"
    monkeypatch.setenv("ZV_HEALTH_FILE", str(health))
    monkeypatch.setattr("zenoh_vision.health.health.STUCK_S", STUCK_S)
    camera = PlainCamera(client)
    release, stuck = threading.Event(), threading.Event()
    node = Node("slow", connection=Connection(router.endpoint, timeout_s=20))

    def loop() -> None:
        for _ in node.frames():
            stuck.set()
            release.wait(30)

    with node:
        reports = Listener(client, "@vision/diagnostics/slow_front")
        worker = threading.Thread(target=loop)
        worker.start()
        try:
            with camera.at(30):
                wait_until(stuck.is_set)
                wait_until(lambda: says(health).startswith("trouble: the loop has been stuck"))
                wait_until(lambda: any(message.body["level"] == 2 for message in reports.messages))
                release.set()
                wait_until(lambda: says(health) == "ok\n")
        finally:
            release.set()
            node.stop()
            worker.join(5)


def test_a_flood_of_queries_does_not_stop_the_beat(router, client, service, health):
    service("tracker")
    wait_for_nodes(client, "tracker_front")
    wait_until(lambda: says(health) == "ok\n")  # a node is announced before its first beat
    flooding = threading.Event()

    def flood() -> None:
        while not flooding.is_set():
            # No replies are awaited: a query in the queue at every moment is the point.
            client.get("@vision/node/tracker_front", zenoh.handlers.RingChannel(1))

    askers = [threading.Thread(target=flood) for _ in range(2)]
    for asker in askers:
        asker.start()
    try:
        for _ in range(2):  # the first may have been on its way
            assert fresh(health)
    finally:
        flooding.set()
        for asker in askers:
            asker.join()


def test_the_router_beats(tmp_path, health):
    router = Router(tmp_path)
    try:
        router.start()
        wait_until(lambda: says(health) == "ok\n")
        assert fresh(health)
    finally:
        router.close()


def one_camera(folder: Path) -> str:
    """Write a launch file; return its path."""
    file = folder / "up.toml"
    file.write_text('[[node]]\nservice = "camera"\nsettings = { rate = 10 }\n')
    return str(file)


def test_zv_up_speaks_for_all_its_nodes(tmp_path, health):
    listen = Router(tmp_path).endpoint
    words = ["up", one_camera(tmp_path), "--plain", "--listen", listen]
    with Program(words, tmp_path, "up", forked=QUICK_ZV) as program:
        wait_until(lambda: "camera_front" in program.output, 30)
        wait_until(lambda: says(health) == "ok\n")
        children = psutil.Process(program.process.pid).children()
        assert len(children) == 2  # router and camera
        assert not [child for child in children if "ZV_HEALTH_FILE" in child.environ()]
        assert program.interrupt() == 0


def test_zv_up_that_waits_for_a_router_elsewhere_is_well(tmp_path, health):
    nobody = Router(tmp_path).endpoint
    words = ["up", one_camera(tmp_path), "--plain", "--connect", nobody]
    with Program(words, tmp_path, "up", forked=ZV):
        wait_until(lambda: says(health) == "ok\n")
        assert fresh(health)


@pytest.mark.parametrize(
    ("state", "level", "silent_s", "expected"),
    [
        ("starting", 2, 0, ""),
        ("running", 0, 0, ""),
        ("running", 3, 0, ""),
        ("running", 2, 0, "camera_front: no picture"),
        ("running", 0, 9, "camera_front silent for 9 s"),
        ("restarting in 4 s", 0, 0, "camera_front restarting in 4 s"),
        ("failed", 0, 0, "camera_front failed"),
        ("finished", 0, 0, ""),
    ],
)
def test_what_zv_up_calls_trouble(state, level, silent_s, expected):
    class Stand(Child):
        alive = state == "running"  # type: ignore[assignment]

    child = Stand("camera_front", [], say=print)
    child.state = state
    health = Node("camera").health.diagnostics()
    health = health.model_copy(update={"level": level, "message": "no picture"})
    arrived_ns = time.monotonic_ns() - silent_s * S
    node = NodeState("camera_front").with_report(health, arrived_ns, 0.0)
    assert failure_of(child, node) == expected
