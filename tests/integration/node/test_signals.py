"""Told to stop, also early, a service closes its session and exits 0 within 2 s."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest

from tests.integration.conftest import a_router, some_services
from tests.support.listening import Listener, living_nodes, open_client, wait_for_nodes
from tests.support.processes import Program, catches
from tests.support.routing import Router, free_endpoint
from tests.support.waiting import wait_until

LIMIT_S = 2.0
SIGNALS = pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=["TERM", "INT"])
SMALL = ("--width", 320, "--height", 240)
NODES = ("camera_front", "tracker_front", "edge_front")


def check_ends(programs: list[Program], number: int) -> None:
    """Send the signal to all, and check how each ends."""
    sent_s = time.monotonic()
    for program in programs:
        program.process.send_signal(number)
    ended: dict[str, tuple[int, float]] = {}

    def all_ended() -> bool:
        for program in programs:
            status = program.process.poll()
            if status is not None and program.name not in ended:
                ended[program.name] = (status, round(time.monotonic() - sent_s, 2))
        return len(ended) == len(programs)

    wait_until(all_ended, 8, lambda: f"{ended}")
    print(ended)
    assert all(status == 0 and after_s < LIMIT_S for status, after_s in ended.values()), ended
    for program in programs:
        assert "Traceback" not in program.complaints
        assert "panicked" not in program.complaints
        assert program.output == ""


def start_all(start, *camera_flags: object) -> list[Program]:
    return [
        start("camera", *SMALL, "--rate", 30, *camera_flags),
        start("tracker"),
        start("edge"),
    ]


@pytest.mark.quiet
@SIGNALS
def test_under_load(router, client, service, number):
    programs = start_all(service)
    wait_for_nodes(client, *NODES)
    listeners = [
        Listener(client, f"vision/front/{suffix}")
        for suffix in ("image", "image/compressed", "tracked/compressed", "edges/compressed")
    ]
    for listener in listeners:
        listener.wait_for(5)
    check_ends(programs, number)
    # The session was closed, so the token is gone before the lease of 2 s could be over.
    wait_until(lambda: not living_nodes(client), 0.5)


@pytest.mark.quiet
def test_while_nothing_comes(router, client, service):
    programs = [service("tracker"), service("edge")]
    wait_for_nodes(client, "tracker_front", "edge_front")
    check_ends(programs, signal.SIGTERM)


@pytest.mark.quiet
@SIGNALS
def test_while_no_router_was_ever_there(tmp_path, number):
    with knocking(tmp_path) as (programs, door, visitors):
        for place in (*visitors, door):
            place.close()
        check_ends(programs, number)


@pytest.mark.quiet
def test_while_the_port_is_taken_by_something_that_never_answers(tmp_path):
    with knocking(tmp_path) as (programs, _, _):
        check_ends(programs, signal.SIGTERM)


@contextmanager
def knocking(
    folder: Path,
) -> Iterator[tuple[list[Program], socket.socket, list[socket.socket]]]:
    """Yield services that have knocked at a door behind which no router is."""
    router = Router(folder)
    with (
        socket.create_server(("127.0.0.1", router.port)) as door,
        some_services(router.endpoint, folder) as start,
        ExitStack() as visitors,
    ):
        door.settimeout(20)
        programs = start_all(start)
        knocks = [visitors.enter_context(door.accept()[0]) for _ in programs]
        for program in programs:  # one may have knocked twice, and another not yet
            wait_until(partial(catches, program.process.pid, signal.SIGTERM))
        yield programs, door, knocks


@pytest.mark.quiet
@pytest.mark.parametrize("stop", [Router.kill, Router.pause], ids=["killed", "frozen"])
def test_after_the_router_was_killed_and_while_it_is_frozen(router, service, stop):
    with open_client(router.endpoint) as client:
        programs = start_all(service)
        wait_for_nodes(client, *NODES)
        Listener(client, "vision/front/centroid").wait_for(5)
    stop(router)
    check_ends(programs, signal.SIGTERM)


@pytest.mark.alone  # the router is frozen for less than the lease
def test_while_a_frozen_router_makes_publishing_block(router, client, service):
    # Raw frames of 6 MB fill the sockets to the frozen router within a few frames.
    camera = service("camera", "--width", 1920, "--height", 1080, "--rate", 15)
    wait_for_nodes(client, "camera_front")
    Listener(client, "vision/front/image").wait_for(3)
    router.pause()
    time.sleep(0.8)  # less than the lease, after which the camera gives the router up
    check_ends([camera], signal.SIGTERM)
    router.resume()


@pytest.mark.quiet
def test_while_the_source_is_stalled(router, client, service):
    camera = service("camera", *SMALL, "--faults", "stall@3+999999", "--stall-after", 3600)
    health = Listener(client, "@vision/diagnostics/camera_front")

    def stalled() -> bool:  # frames 0 to 2 may be gone before anyone subscribes
        reports = health.messages
        return bool(reports) and reports[-1].body["counters"]["captured"] == 3

    wait_until(stalled)
    check_ends([camera], signal.SIGTERM)


@pytest.mark.quiet
def test_the_router_itself(tmp_path):
    with (
        a_router(tmp_path) as router,
        some_services(router.endpoint, tmp_path) as start,
        open_client(router.endpoint) as client,
    ):
        start_all(start)
        wait_for_nodes(client, *NODES)
        check_ends([router.program], signal.SIGTERM)


@pytest.mark.quiet
def test_a_second_signal_does_no_harm(router, client, service):
    programs = start_all(service)
    wait_for_nodes(client, *NODES)
    for program in programs:
        program.process.send_signal(signal.SIGINT)
    check_ends(programs, signal.SIGTERM)


STEP_S = 0.07


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
@pytest.mark.parametrize("step", range(8))
def test_it_ends_with_0_at_once_and_says_nothing(tmp_path, step):
    with Program(
        ["-m", "zv", "camera", "--connect", free_endpoint()], tmp_path, "camera"
    ) as program:
        wait_until(lambda: catches(program.process.pid, signal.SIGTERM))
        time.sleep(step * STEP_S)  # another place in its start each time
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(3) == 0
    assert "Traceback" not in program.complaints
