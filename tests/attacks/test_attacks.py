"""Every attack on a system of processes: all survive in bounded memory, and count what they lose.

Alone on the machine, since the good frames must be back within 2 s.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass

import pytest

from tests.integration.conftest import QUICK_ZV, some_services
from tests.support.attacks.observer import BACK_S, Observer
from tests.support.attacks.table import ATTACKS, NODES, USUAL, run, under
from tests.support.listening import open_client, wait_for_nodes
from tests.support.processes import Program, peak_bytes
from tests.support.routing import Router
from tests.support.viewer.client import Viewer

pytestmark = pytest.mark.alone
MOST_BYTES = 512 << 20
"""The limit of a container, see docker-compose.yml."""


@dataclass
class System:
    """Router, camera, tracker, edge detector and viewer, each in a process of its own."""

    endpoint: str
    programs: dict[str, Program]
    observer: Observer


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder = tmp_path_factory.mktemp("attacks")
    size = [word for name in ("width", "height") for word in (f"--{name}", USUAL[name])]
    with ExitStack() as ending:
        router = ending.enter_context(closing(Router(folder)))
        router.start()
        start = ending.enter_context(some_services(router.endpoint, folder, QUICK_ZV))
        flags = {
            "camera_front": ["camera", *size],
            # The attacks come over the network, from which shared memory would shield them.
            "tracker_front": ["tracker", "--transport", "jpeg"],
            "edge_front": ["edge", "--transport", "jpeg"],
            "viewer": ["view", "--port", 0],
        }
        programs = {node: start(*flags[node]) for node in NODES}
        with open_client(router.endpoint) as session:
            wait_for_nodes(session, *NODES)
        viewer = Viewer(programs["viewer"])
        observer = ending.enter_context(closing(Observer(router.endpoint, viewer.port)))
        observer.back_s(time.time_ns())
        yield System(router.endpoint, programs, observer)


@pytest.mark.parametrize("name", ATTACKS)
def test_good_frames_are_back_and_every_loss_is_counted(system: System, name: str):
    attack = ATTACKS[name]
    before = system.observer.health() if attack.dropped else {}
    most_back_s = system.observer.most_back_s(attack)
    with open_client(system.endpoint) as session:
        run(session, attack)
        over_ns = time.time_ns()
        back_s = system.observer.back_s(over_ns)
    after = system.observer.health()
    peaks = {node: peak_bytes(one.process.pid) for node, one in system.programs.items()}
    print({node: f"{back_s[node]:.2f} s, {peaks[node] / 1e6:.0f} MB" for node in NODES})
    assert max(back_s.values()) <= most_back_s, back_s
    assert max(peaks.values()) < MOST_BYTES, peaks
    for node in ("tracker_front", "edge_front") if attack.dropped else ():
        reason = f"dropped.{attack.dropped}"
        counted = after[node].counters[reason] - before[node].counters.get(reason, 0)
        assert counted == attack.count, node


def test_each_service_ends_within_2_s_of_sigterm_under_attack(system: System):
    """Last, since it ends them; the containers are told to end during each attack."""
    # 2 MB/s of what costs most to receive, to decode and to answer
    names = ("scan bomb", "costliest PNG for the tracker", "nested without end", "endless tokens")
    with open_client(system.endpoint) as session, ExitStack() as attacks:
        for name in names:
            attacks.enter_context(under(session, ATTACKS[name]))
        told_s = time.monotonic()
        for program in system.programs.values():
            program.process.terminate()
        status = {}
        for node, program in system.programs.items():
            status[node] = program.process.wait(max(0.0, told_s + BACK_S - time.monotonic()))
        print(f"all ended within {time.monotonic() - told_s:.2f} s")
    assert set(status.values()) == {0}, status
