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
from tests.support.processes import Program
from tests.support.secured import Secured, official, secured
from tests.support.waiting import wait_until
from zenoh_vision.messages import Diagnostics, ParameterList
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
            report = self.newest(f"@vision/diagnostics/{node}")
            counters = Diagnostics.from_bytes(report).counters
            for name, count in counters.items():
                reason = name.partition("dropped.")[2]
                if reason and reason not in USUAL and count:
                    found[f"{node} {reason}"] = count
        return found

    def revisions(self) -> dict[str, int]:
        return {
            node: ParameterList.from_bytes(self.newest(f"@vision/param/{node}")).revision
            for node in NODES
        }

    def tokens(self) -> set[str]:
        replies = self.link.session.liveliness().get("@vision/node/*", timeout=5.0)
        return {str(each.ok.key_expr).rpartition("/")[2] for each in replies if each.ok}

    def newest(self, key: str) -> bytes:
        def reply() -> bytes | None:
            replies = self.link.session.get(key, timeout=5.0)
            return next((each.ok.payload.to_bytes() for each in replies if each.ok), None)

        return wait_until(reply, 30)

    def processed(self, node: str) -> int:
        report = Diagnostics.from_bytes(self.newest(f"@vision/diagnostics/{node}"))
        return report.counters["processed"]


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder: Path = tmp_path_factory.mktemp("attacked")
    system = secured(folder, camera=("front", "back"))
    with ExitStack() as running:
        running.enter_context(official(system, folder))
        for name in ("camera", "tracker", "edge"):
            words = [name, "--connect", system.endpoint]
            words += ["--credentials", system.file(f"{name}_front")]
            words += [] if name == "camera" else ["--transport", "jpeg"]
            running.enter_context(Program(words, folder, name, forked=ZV))
        link = Link(system.connection("guest"))
        running.callback(link.close)
        found = System(system, link)
        wait_until(lambda: found.tokens() == set(NODES), 60)
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
    assert system.tokens() == set(NODES)
    for node in ("tracker_front", "edge_front"):
        done = system.processed(node)
        wait_until(lambda node=node, done=done: system.processed(node) > done, 10)


def test_a_message_over_the_limit_ends_the_attackers_own_connection_only(system: System):
    with system.secured.client("camera_back") as session:
        attack = ATTACKS["140 MB, over the limit of a message"]
        run(session, replace(attack, count=1))
    assert system.tokens() == set(NODES)
    assert system.faults() == {}
