"""Thousands of names from a program that invents them: the real nodes are shown all the same."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgpack
import psutil
import pytest
import zenoh

from tests.integration.conftest import a_router
from tests.support.listening import open_client
from tests.support.node_states import report
from tests.support.processes import START_S, Program
from tests.support.routing import Router
from tests.support.standing_in import StandIn
from tests.support.typist import quick_zv, zv
from tests.support.waiting import wait_until

REAL = ["camera_front", "edge_front", "tracker_front", "viewer"]
FAKES = 2000


@pytest.fixture(scope="module")
def router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Router]:
    """A router with four nodes."""
    with a_router(tmp_path_factory.mktemp("router")) as running, ExitStack() as sessions:
        kept = [StandIn(sessions.enter_context(open_client(running.endpoint)), n) for n in REAL]
        yield running
        kept.clear()


@contextmanager
def many_tokens(endpoint: str) -> Iterator[None]:
    """Show tokens under thousands of names; the first in the order of the alphabet."""
    with open_client(endpoint) as session:
        tokens = session.liveliness()
        kept = [tokens.declare_token(f"@vision/node/a_fake{n}") for n in range(FAKES)]
        yield
        kept.clear()


def test_after_the_flood_all_is_as_before(router: Router):
    with many_tokens(router.endpoint):
        wait_until(lambda: len(names(router)) == 1000, START_S)
    wait_until(lambda: names(router) == REAL, START_S)


@pytest.fixture(scope="module")
def flooded(router: Router) -> Iterator[Router]:
    with many_tokens(router.endpoint):
        wait_until(lambda: len(names(router)) == 1000, START_S)
        yield router


def test_node_list_shows_the_real_nodes_first_and_says_that_it_is_cut(flooded: Router):
    done = zv(flooded.endpoint, "node", "list", "--json")
    nodes = [json.loads(line) for line in done.stdout.splitlines()]
    assert [each["node"] for each in nodes[:4]] == REAL
    assert len(nodes) <= 1000
    assert "1000 nodes are shown, those first that answer" in done.stderr


def test_node_info_shows_the_real_nodes(flooded: Router):
    done = zv(flooded.endpoint, "node", "info", "*r*", "--json")
    nodes = [json.loads(line)["node"] for line in done.stdout.splitlines()]
    assert nodes == REAL


def test_top_shows_the_real_nodes_first_and_says_that_it_is_cut(flooded: Router):
    done = quick_zv(flooded.endpoint, "top", "--once")
    rows = [line.split() for line in done.stdout.splitlines() if " running " in line]
    assert sorted(row[0] for row in rows) == REAL
    assert done.stdout.index(rows[-1][0]) < done.stdout.index("a_fake")
    assert "more are left out" in done.stderr


def test_the_doctor_names_the_real_nodes_and_the_flood(flooded: Router):
    done = zv(flooded.endpoint, "doctor", "configs/edge.toml", "--for", "1.2", "--json")
    found = [json.loads(line) for line in done.stdout.splitlines()]
    (namespace,) = (each["text"] for each in found if each["check"] == "namespace")
    assert namespace.startswith(f"vision: {', '.join(REAL)}, a_fake")
    (answers,) = (each["text"] for each in found if each["check"] == "answers")
    assert "tokens are shown by nodes that do not answer: a_fake" in answers
    assert {each["check"] for each in found} >= {"cameras", "drops", "speed", "health"}


def test_metrics_serve_the_real_nodes_and_count_what_is_left_out(flooded: Router, tmp_path: Path):
    arguments = ["metrics", "--listen", "127.0.0.1:0", "--connect", flooded.endpoint]
    with Program(arguments, tmp_path, "metrics", forked="tests.support.programs.quick_zv") as zv:
        (url,) = zv.lines("http://.*")

        def served() -> bool:
            with urllib.request.urlopen(url[0], timeout=10) as answer:
                text = answer.read().decode()
            counted = 'messages_rejected_total{reason="too_many"}' in text
            return counted and all(
                f'node_info{{camera="front",host="elsewhere",node="{n}"' in text for n in REAL
            )

        wait_until(served, START_S)


def names(router: Router) -> list[str]:
    done = zv(router.endpoint, "node", "list", "--json")
    return [json.loads(line)["node"] for line in done.stdout.splitlines()]


def flood_reports(session: zenoh.Session, count: int) -> None:
    """Send large reports, each under a name of its own."""
    for n in range(count):
        counters = {f"dropped.{n}_{c}_{'x' * 100}": c for c in range(100)}
        fields = report(node=f"fake{n}", counters=counters).to_map()
        session.put(f"@vision/diagnostics/fake{n}", msgpack.packb(fields))
        if n % 50 == 0:
            session.get("@vision/node/camera_front")  # keeps pace with the router


def test_zv_up_keeps_no_report_of_nodes_that_it_did_not_start(router: Router, tmp_path: Path):
    launch = tmp_path / "up.toml"
    launch.write_text('[[node]]\nservice = "camera"\ncamera = "left"\n')
    arguments = ["up", str(launch), "--plain", "--connect", router.endpoint]
    with (
        open_client(router.endpoint) as session,
        Program(arguments, tmp_path, "up", forked="tests.support.programs.quick_zv") as up,
    ):
        up.lines("camera_left +running.*")
        process = psutil.Process(up.process.pid)
        before_mb = process.memory_info().rss / 1e6
        flood_reports(session, 1500)
        seen = up.output.count("camera_left  ")
        wait_until(lambda: up.output.count("camera_left  ") > seen + 1, START_S)
        assert process.memory_info().rss / 1e6 - before_mb < 15
