"""Every attack on the containers, whose memory is limited: each survives, and ends when told."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.compose.conftest import SMALL
from tests.support.attacks.observer import Observer
from tests.support.attacks.table import ATTACKS, run, under
from tests.support.containers import stack as containers
from tests.support.containers.stack import SERVICES, Stack
from tests.support.listening import open_client
from tests.support.processes import peak_bytes
from tests.support.waiting import DEADLINE_S, wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(300)]
END_S = 2.0
SLOWER = 5.0
"""An end during an attack may take so many times what it takes in peace: more than 2 s only where
the machine is so slow that peace takes long, too."""
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


@pytest.fixture(scope="module")
def end_s(stack: Stack, observer: Observer) -> float:
    """How long the services may take to end."""
    in_peace_s = end_and_start(stack, DEADLINE_S)
    observer.back_s(time.time_ns())
    return max(END_S, SLOWER * in_peace_s)


@pytest.mark.parametrize("name", ATTACKS)
def test_all_survive_it_and_end_during_it(
    stack: Stack, observer: Observer, end_s: float, name: str
):
    lives = {service: life_of(stack, service) for service in SERVICES}
    most_back_s = observer.most_back_s(ATTACKS[name])
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
    assert max(back_s.values()) <= most_back_s, back_s
    try:
        with open_client(stack.endpoint) as session, under(session, ATTACKS[name]):
            took_s = end_and_start(stack, end_s)
        print(f"all ended within {took_s:.2f} s of {end_s:.2f}")
    finally:
        observer.back_s(time.time_ns())  # the next attack finds all as this one did
    assert life_of(stack, "router") == lives["router"]


def life_of(stack: Stack, service: str) -> tuple[object, ...]:
    """Return what changes when a container is started again, or has had too little memory."""
    return *stack.starts(service), stack.inspect(service)["State"]["OOMKilled"]


def end_and_start(stack: Stack, deadline_s: float) -> float:
    """Tell all services to end at once; they do, in time and with status 0. Start them again.

    Return how long the slowest took.
    """
    ids = [stack.container(service) for service in OURS]
    workers = {service: Path(f"/proc/{stack.worker(service)}") for service in OURS}
    containers.run("docker", "kill", "--signal", "TERM", *ids)
    told_s = time.monotonic()
    try:
        wait_until(
            lambda: not any(worker.exists() for worker in workers.values()),
            deadline_s,
            lambda: str([service for service, worker in workers.items() if worker.exists()]),
        )
        took_s = time.monotonic() - told_s
    finally:
        status = containers.run("docker", "wait", *ids).split()
        containers.run("docker", "start", *ids)
    assert status == ["0"] * len(ids), status
    return took_s
