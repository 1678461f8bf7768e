"""Programs that answer what no node would: no tool fails, and it says when two answer for one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.listening import open_client
from tests.support.standing_in import StandIn
from tests.support.typist import zv
from zenoh_vision.health.fleet import MAX_NODES

NODE = "tracker_front"
ROUTER = f"@/{'ab' * 8}/router"
DEEP = b"[" * 100_000


@contextmanager
def answering(
    session: zenoh.Session, key: str, say: Callable[[zenoh.Query], Any]
) -> Iterator[None]:
    """Answer queries on a key; with an error where an exception is said."""

    def on_query(query: zenoh.Query) -> None:
        with query:
            said = say(query)
            if isinstance(said, Exception):
                query.reply_err(said.args[0])
            else:
                query.reply(key.replace("**", "publisher/x"), said)

    queryable = session.declare_queryable(key, zenoh.handlers.Callback(on_query, indirect=False))
    yield
    queryable.undeclare()


def parameters(low: float, *, node: str = NODE, revision: int = 1) -> bytes:
    one = {"node": node, "name": "low", "type": "float", "value": low, "default": 1.0}
    return msgpack.packb({"node": node, "revision": revision, "parameters": [one]})


@pytest.mark.parametrize("words", ["doctor configs/edge.toml --for 1.2", "topic list --window 0.1"])
def test_json_nested_without_end_in_a_routers_admin_space_ends_no_tool(endpoint, client, words):
    with (
        answering(client, f"{ROUTER}/**", lambda _: DEEP),
        answering(client, ROUTER, lambda _: DEEP),
    ):
        done = zv(endpoint, *words.split())
    assert done.returncode in (0, 1), done.stderr


@pytest.mark.parametrize(
    "counters",
    [
        pytest.param(
            lambda s: {"received": 0, "missed": int(20 * s) + 5, "dropped.overwritten": int(9 * s)},
            id="more lost than came",
        ),
        pytest.param(
            lambda s: {"received": 100 - int(s), "dropped.stale": max(0, 50 - int(s))},
            id="backwards",
        ),
        pytest.param(lambda s: {"captured": int(s), "pending": 2**64 - 1}, id="pending"),
    ],
)
def test_impossible_counters_hide_no_check_of_the_doctor(endpoint, client, counters):
    namespace = "counts"
    stand_in = StandIn(
        client, NODE, namespace=namespace, counters=counters, second_s=0.2, service="tracker"
    )
    done = zv(endpoint, "doctor", "configs/edge.toml", "--for", "1.2", "--namespace", namespace)
    assert done.returncode in (0, 1), done.stderr
    assert "\nhealth" in done.stdout.replace("OK   ", "").replace("WARN ", "")
    del stand_in


def test_an_answer_with_other_parameters_than_before_is_no_fault(endpoint, client):
    empty = msgpack.packb({"node": NODE, "revision": 1, "parameters": []})

    with (
        answering(client, f"@vision/param/{NODE}", lambda _: empty),
        answering(client, f"@vision/set/{NODE}", lambda _: parameters(3.0)),
    ):
        done = zv(endpoint, "param", "set", NODE, "low=3")
    assert (done.returncode, done.stdout) == (0, "low: not set -> 3.0\n"), done.stderr


def test_two_nodes_of_one_name_are_refused_and_none_is_set(endpoint, client):
    key = f"@vision/param/{NODE}"
    changes: list[zenoh.Query] = []

    def say(_query: zenoh.Query) -> bytes:
        return parameters(1.0)

    with (
        open_client(endpoint) as other,
        answering(client, key, say),
        answering(other, key, say),
        answering(client, f"@vision/set/{NODE}", changes.append),
    ):
        for words in ("get", "describe", "dump", "set low=1"):
            command, *rest = words.split()
            done = zv(endpoint, "param", command, NODE, *rest)
            assert (done.returncode, done.stdout) == (1, ""), done.stderr
            assert f"2 nodes are called {NODE}, and it is unknown which one is meant" in done.stderr
        listed = zv(endpoint, "param", "list")
        assert f"2 nodes are called {NODE}; see zv doctor" in listed.stderr
    assert not changes


@pytest.mark.parametrize(
    "said",
    [
        b"\x91" * 900_000 + b"\x90",
        b"no message",
        parameters(9.0, node="camera_front"),
        ValueError(b"\x1b[2Jgo away"),
    ],
    ids=["deep", "garbage", "another node", "error"],
)
def test_an_impostors_unreadable_answer_does_not_hide_the_nodes_own(endpoint, client, said):
    key = f"@vision/param/{NODE}"
    with (
        open_client(endpoint) as other,
        answering(client, key, lambda _: parameters(1.0)),
        answering(other, key, lambda _: said),
    ):
        done = zv(endpoint, "param", "get", NODE, "low")
    assert (done.returncode, done.stdout) == (0, "1.0\n"), done.stderr


def test_many_invented_nodes_and_a_refusal_do_not_hide_the_nodes_that_match(endpoint, client):
    def flood(query: zenoh.Query) -> None:
        with query:
            for name in [NODE, *(f"a{number}" for number in range(MAX_NODES))]:
                query.reply(f"@vision/param/{name}", parameters(1.0, node=name))
            query.reply_err(msgpack.packb({"error": "no", "allowed": "nothing"}))

    queryable = client.declare_queryable("@vision/param/*", flood)
    one, every = (zv(endpoint, "param", "list", pattern) for pattern in ("track*", "*"))
    queryable.undeclare()
    assert [row.split()[:2] for row in one.stdout.splitlines()[2:]] == [[NODE, "low"]], one.stderr
    assert (one.returncode, one.stderr) == (0, "")
    assert every.returncode == 0
    assert "1 more nodes match and are left out" in every.stderr
