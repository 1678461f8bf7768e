"""The attacks of tests/attacks, with a certificate: what is not one's own is not touched."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
import zenoh

from tests.support.attacks.table import ATTACKS, run
from tests.support.fork_server import ZV
from tests.support.listening import living_nodes, newest
from tests.support.processes import Program
from tests.support.secured import Secured, official, secured
from tests.support.waiting import wait_until
from zenoh_vision.transport.link import Link

NODES = ("camera_front", "tracker_front", "edge_front")
USUAL = {"overwritten", "stale", "missed", "no_subscriber"}
"""Why frames are dropped without anybody's fault, on a machine that is busy."""

MOST = 4
"""How often each is tried here; tests/attacks tries more."""


@dataclass
class System:
    secured: Secured
    link: Link

    def faults(self) -> dict[str, int]:
        """Return what the consumers dropped as wrong, by node and reason."""
        found: dict[str, int] = {}
        for node in NODES:
            for name, count in self.counters(node).items():
                reason = name.partition("dropped.")[2]
                if reason and reason not in USUAL and count:
                    found[f"{node} {reason}"] = count
        return found

    def revisions(self) -> dict[str, int]:
        return {
            node: newest(self.link.session, f"@vision/param/{node}").body["revision"]
            for node in NODES
        }

    def counters(self, node: str) -> dict[str, int]:
        return newest(self.link.session, f"@vision/diagnostics/{node}").body["counters"]

    def processed(self, node: str) -> int:
        return self.counters(node)["processed"]

    def all_live(self) -> bool:
        return living_nodes(self.link.session) == {f"@vision/node/{node}" for node in NODES}


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder: Path = tmp_path_factory.mktemp("attacked")
    system = secured(folder, camera=("front", "back"))
    with ExitStack() as running:
        running.enter_context(official(system, folder))
        for name in ("camera", "tracker", "edge"):
            words = [name, "--connect", system.endpoint]
            words += ["--credentials", system.file(f"{name}_front")]
            words += ["--rate", "10"] if name == "camera" else ["--transport", "jpeg"]
            running.enter_context(Program(words, folder, name, forked=ZV))
        link = Link(system.connection("guest"))
        running.callback(link.close)
        found = System(system, link)
        wait_until(found.all_live, 60)
        yield found


@pytest.fixture(params=["guest", "camera_back"])
def attacker(request: pytest.FixtureRequest, system: System) -> Iterator[zenoh.Session]:
    with system.secured.client(request.param) as session:
        yield session


ON_OTHERS = [name for name in ATTACKS if "140 MB" not in name and "100 MB" not in name]


def test_no_attack_with_a_certificate_touches_what_is_not_the_attackers(
    system: System, attacker: zenoh.Session
):
    before = system.faults(), system.revisions()
    for name in ON_OTHERS:
        attack = ATTACKS[name]
        # Nobody asks who may not answer, so there is nothing to wait for.
        run(attacker, replace(attack, count=min(attack.count, MOST), rate_hz=100, is_asked=False))
    assert (system.faults(), system.revisions()) == before
    assert system.all_live()
    for node in ("tracker_front", "edge_front"):
        done = system.processed(node)
        wait_until(lambda node=node, done=done: system.processed(node) > done, 10)


def test_a_message_over_the_limit_ends_the_attackers_own_connection_only(system: System):
    with system.secured.client("camera_back") as session:
        attack = ATTACKS["140 MB, over the limit of a message"]
        run(session, replace(attack, count=1))
    assert system.all_live()
    assert system.faults() == {}
