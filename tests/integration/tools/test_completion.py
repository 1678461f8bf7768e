"""Completion from the running system: keys, nodes, parameters, values; silent without a router."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator

import msgpack
import pytest
import zenoh

from tests.integration.conftest import a_router
from tests.support.listening import known_queryable, open_client
from tests.support.processes import ROOT, environment
from tests.support.routing import free_endpoint, silent_listener
from tests.support.waiting import wait_until
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zv.cli.completion import completions
from zv.edge.settings import EdgeSettings
from zv.tools.shared import names

CPU_S = 0.3
"""What a shell may wait for, in a process that no other delays."""


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A router with an edge detector, and a publisher of another program."""
    with (
        a_router(tmp_path_factory.mktemp("router")) as router,
        open_client(router.endpoint) as client,
        Node(
            "edge",
            connection=Connection(router.endpoint, timeout_s=20),
            publishes=["edges/compressed"],
            parameters=ParameterStore(EdgeSettings()),
        ),
        client.declare_publisher("lab/bench/temperature"),
        client.liveliness().declare_token("@vision/node/two words;rm"),
    ):
        yield router.endpoint


@pytest.fixture(autouse=True)
def _a_busy_machine_may_take_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(names, "OPEN_S", 10.0)
    monkeypatch.setattr(names, "REPLY_S", 10.0)


def completed(endpoint: str, typed: str) -> list[str] | None:
    """Return the completions of a line's last word."""
    *words, incomplete = typed.split(" ")
    return completions(["--connect", endpoint, *words], incomplete)


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("topic echo vision/front/e", ["vision/front/edges/compressed"]),
        ("topic hz lab", ["lab/bench/temperature"]),
        ("node info ", ["edge_front"]),
        ("node info x", []),
        ("param get edge_front l", ["l2", "low"]),
        ("param set edge_front low=3 l", ["l2"]),
        ("param set edge_front format ", ["bits", "jpeg", "png"]),
        ("param set edge_front l2 t", ["true"]),
        ("param set edge_front nothing ", []),
        ("param get nobody ", []),
        ("param get @x/** ", []),
    ],
)
def test_names_of_the_running_system_are_offered(
    endpoint: str, typed: str, expected: list[str]
) -> None:
    wait_until(lambda: completed(endpoint, typed) == expected, 20)


@pytest.mark.parametrize(
    "said", [b"\xc1", b"\x91" * 5000, msgpack.packb({"parameters": [1, {}, {"name": 5}]})]
)
def test_an_answer_that_is_no_message_offers_nothing(endpoint: str, said: bytes) -> None:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply("@vision/param/odd", said)

    with open_client(endpoint) as client, known_queryable(client, "@vision/param/odd", answer):
        assert completed(endpoint, "param get odd ") == []


def test_without_a_router_there_are_no_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(names, "OPEN_S", 0.1)
    assert completed(free_endpoint(), "topic echo ") == []


def test_a_router_that_says_nothing_delays_a_shell_by_its_time_limits_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(names, "OPEN_S", 0.1)
    with silent_listener() as (port, _):
        began_s = time.monotonic()
        assert completed(f"tcp/127.0.0.1:{port}", "topic echo ") == []
        assert time.monotonic() - began_s < 5  # 0.2 s where nothing else runs


def test_a_wrong_endpoint_is_silent() -> None:
    assert completed("tcp/nowhere", "topic echo ") == []
    assert completions(["--namespace", "A*", "topic", "echo"], "") == []


@pytest.mark.parametrize("reachable", [True, False], ids=["a system", "no router"])
def test_a_shell_is_answered_within_a_third_of_a_second_of_work(
    endpoint: str, reachable: bool
) -> None:
    variables = environment() | {
        "_ZV_COMPLETE": "bash_complete",
        "COMP_WORDS": f"zv --connect {endpoint if reachable else free_endpoint()} node info ",
        "COMP_CWORD": "5",
    }
    reading, writing = os.pipe()
    actions = [(os.POSIX_SPAWN_DUP2, writing, 1), (os.POSIX_SPAWN_DUP2, writing, 2)]
    command = [sys.executable, "-m", "zv"]
    os.chdir(ROOT)
    pid = os.posix_spawn(sys.executable, command, variables, file_actions=actions)
    os.close(writing)
    with os.fdopen(reading) as said:
        text = said.read()
    _, status, used = os.wait4(pid, 0)
    assert status == 0
    assert text in (["plain,edge_front\n", ""] if reachable else [""])
    assert used.ru_utime + used.ru_stime < CPU_S
