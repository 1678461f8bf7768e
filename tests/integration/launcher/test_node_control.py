"""zv node stop, start and restart: of the nodes that zv up runs, and what is said of others."""

from __future__ import annotations

import re
from collections.abc import Iterator

import msgpack
import psutil
import pytest

from tests.integration.conftest import QUICK_ZV, some_services
from tests.support.listening import living_nodes, open_client
from tests.support.processes import Program
from tests.support.routing import free_endpoint
from tests.support.typist import zv
from tests.support.waiting import wait_until
from zenoh_vision.messages import Refusal

SYSTEM = """\
[[node]]
service = "camera"
settings = { width = 160, height = 120, rate = 5 }
[[node]]
service = "sleeper"
command = "sleep 1000"
[[node]]
service = "stubborn"
command = ["sh", "-c", "trap '' TERM; sleep 1000 & wait; sleep 1000"]
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Program, str]]:
    """A running zv up and its endpoint."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "up.toml").write_text(SYSTEM)
    endpoint = free_endpoint()
    words = ["up", "--plain", str(folder / "up.toml"), "--listen", endpoint, "--grace", "1s"]
    with Program(words, folder, "up", forked=QUICK_ZV) as program:
        program.lines(r"camera_front +running +rate.*")
        yield program, endpoint


def state_of(program: Program, node: str) -> str:
    """Return the last state that zv up showed of a node."""
    found = re.findall(rf"^{node} +(\S[^\n]*?)(?:  |$)", program.output, re.MULTILINE)
    return found[-1] if found else ""


def processes(program: Program, word: str) -> list[int]:
    family = psutil.Process(program.process.pid).children(recursive=True)
    return [each.pid for each in family if each.is_running() and word in each.cmdline()]


def test_a_node_is_stopped_stays_so_and_is_started_again(site):
    program, endpoint = site
    done = zv(endpoint, "node", "stop", "camera_front")
    assert (done.returncode, done.stdout) == (0, "camera_front: stopped\n")
    assert not processes(program, "camera")
    with open_client(endpoint) as session:
        wait_until(lambda: "@vision/node/camera_front" not in living_nodes(session))
    wait_until(lambda: state_of(program, "camera_front") == "stopped")
    assert program.process.poll() is None
    done = zv(endpoint, "node", "start", "camera_front")
    assert (done.returncode, done.stdout) == (0, "camera_front: starting\n")
    with open_client(endpoint) as session:
        wait_until(lambda: "@vision/node/camera_front" in living_nodes(session))


def test_restarting_makes_another_process(site):
    program, endpoint = site
    (before,) = processes(program, "1000") and [processes(program, "1000")[0]]
    done = zv(endpoint, "node", "restart", "sleeper", "--json")
    assert done.stdout == '{"node": "sleeper", "state": "starting"}\n'
    assert before not in processes(program, "1000")
    assert processes(program, "1000")


def test_a_node_that_does_not_end_is_killed_after_the_grace_of_the_launch_file(site):
    program, endpoint = site
    done = zv(endpoint, "node", "stop", "stubborn")
    assert done.stdout == "stubborn: stopped\n"
    assert "stubborn did not end in time: killed" in program.complaints


def test_a_node_started_by_hand_takes_the_row_of_the_one_that_was_stopped(site, tmp_path):
    program, endpoint = site
    zv(endpoint, "node", "stop", "camera_front")
    with some_services(endpoint, tmp_path) as start:
        start("camera", "--width", 160, "--height", 120, "--rate", 5)
        wait_until(lambda: state_of(program, "camera_front") == "running, by hand")
        done = zv(endpoint, "node", "stop", "camera_front")
        assert done.stdout == "camera_front: stopped\n"  # its own; that by hand is not its child
    wait_until(lambda: state_of(program, "camera_front") == "stopped")
    zv(endpoint, "node", "start", "camera_front")


@pytest.mark.parametrize(
    ("node", "said"),
    [
        ("tracker_rear", "nothing matches tracker_rear: .*these exist: camera_front, sleeper"),
        ("edge_hand", r"edge_hand was started by hand \(pid \d+ on \S+\), not by zv up"),
    ],
)
def test_a_node_that_zv_up_does_not_run_is_refused_with_the_reason(site, tmp_path, node, said):
    _, endpoint = site
    with some_services(endpoint, tmp_path) as start:
        start("edge", "--camera", "hand")
        with open_client(endpoint) as session:
            wait_until(lambda: "@vision/node/edge_hand" in living_nodes(session))
        done = zv(endpoint, "node", "stop", node)
    assert done.returncode == 1
    assert re.search(said, done.stderr), done.stderr


def test_strange_requests_are_refused_and_change_nothing(site):
    program, endpoint = site
    with open_client(endpoint) as session:
        for key, payload in (
            ("@vision/launch/sleeper", msgpack.packb("explode")),
            ("@vision/launch/sleeper", b"\xc1"),
            ("@vision/launch/*", msgpack.packb("stop")),
        ):
            (reply,) = list(session.get(key, payload=payload, timeout=5.0))
            assert reply.ok is None
            assert (
                "one of stop, start, restart"
                in Refusal.from_bytes(reply.err.payload.to_bytes()).allowed
            )
        replies = list(session.get("@vision/launch/*", timeout=5.0))
        states = {
            str(reply.ok.key_expr): msgpack.unpackb(reply.ok.payload.to_bytes())
            for reply in replies
            if reply.ok
        }
    assert states["@vision/launch/sleeper"].startswith(("running", "starting"))
    assert program.process.poll() is None
