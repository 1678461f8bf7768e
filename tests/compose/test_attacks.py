"""Every attack on the containers, whose memory is limited: each survives, and ends when told."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.attacks.observer import Observer
from tests.attacks.table import ATTACKS, run, under
from tests.compose import stack as containers
from tests.compose.conftest import SMALL
from tests.compose.stack import SERVICES, Stack
from tests.support.listening import open_client
from tests.support.processes import peak_bytes
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(300)]
END_S = 2.0
OURS = tuple(service for service in SERVICES if service != "router")


TOKEN = "0123456789-of-attacks"


@pytest.fixture(scope="module")
def stack(image: str, clone: Path) -> Iterator[Stack]:
    """As for the other tests; but the viewer has the same token when it is started again."""
    with Stack(clone, settings={**SMALL, "ZV_VIEWER_TOKEN": TOKEN}) as running:
        running.wait_until_healthy()
        yield running


@pytest.fixture(scope="module")
def observer(stack: Stack) -> Iterator[Observer]:
    with closing(Observer(stack.endpoint, stack.viewer_port, TOKEN)) as watching:
        watching.back_s(time.time_ns())
        yield watching


@pytest.mark.parametrize("name", ATTACKS)
def test_all_survive_it_and_end_during_it(stack: Stack, observer: Observer, name: str):
    lives = {service: life_of(stack, service) for service in SERVICES}
    with open_client(stack.endpoint) as session:
        run(session, ATTACKS[name])
        over_ns = time.time_ns()
        back_s = observer.back_s(over_ns)
    observer.health()
    peaks = {service: peak_bytes(stack.worker(service)) for service in SERVICES}
    print(
        name,
        {service: f"{peak / 1e6:.0f} MB" for service, peak in peaks.items()},
        {node: f"{seconds:.2f} s" for node, seconds in back_s.items()},
    )
    assert {service: life_of(stack, service) for service in SERVICES} == lives
    assert max(back_s.values()) <= observer.most_back_s(ATTACKS[name]), back_s
    try:
        with open_client(stack.endpoint) as session, under(session, ATTACKS[name]):
            end_and_start(stack)
    finally:
        observer.back_s(time.time_ns())  # the next attack finds all as this one did
    assert life_of(stack, "router") == lives["router"]


def life_of(stack: Stack, service: str) -> tuple[object, ...]:
    """Return what changes when a container is started again, or has had too little memory."""
    return *stack.starts(service), stack.inspect(service)["State"]["OOMKilled"]


def end_and_start(stack: Stack) -> None:
    """Tell all services to end at once; they do, in time and with status 0. Start them again."""
    ids = [stack.container(service) for service in OURS]
    workers = {service: Path(f"/proc/{stack.worker(service)}") for service in OURS}
    containers.run("docker", "kill", "--signal", "TERM", *ids)
    told_s = time.monotonic()
    try:
        wait_until(
            lambda: not any(worker.exists() for worker in workers.values()),
            END_S,
            lambda: str([service for service, worker in workers.items() if worker.exists()]),
        )
        print(f"all ended {time.monotonic() - told_s:.2f} s after the last was told")
    finally:
        status = containers.run("docker", "wait", *ids).split()
        containers.run("docker", "start", *ids)
    assert status == ["0"] * len(ids), status
