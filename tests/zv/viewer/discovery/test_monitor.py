"""Which replies of nodes count, and how nodes are found again."""

import asyncio
import json
from types import SimpleNamespace
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.node_states import description
from tests.support.waiting import DEADLINE_S
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.messages import NodeDescription, Parameter, ParameterList
from zenoh_vision.transport.query import Replies, Reply
from zv.viewer.discovery import monitor
from zv.viewer.discovery.monitor import MAX_DESCRIPTION_BYTES, SystemMonitor, _of_their_nodes
from zv.viewer.discovery.network import Network
from zv.viewer.discovery.system_state import SystemState


def reply(key: str, payload: bytes) -> Reply:
    sample: Any = SimpleNamespace(key_expr=key, payload=zenoh.ZBytes(payload))
    return Reply(sample, None, "", 0, 0)


def test_a_description_counts_on_the_key_of_its_node_alone_and_up_to_a_size():
    own = description(node="a")
    endless = description(node="b", publishes=("x" * MAX_DESCRIPTION_BYTES,))
    replies = [
        reply("@vision/node/other", own.to_bytes()),
        reply("@vision/node/b", endless.to_bytes()),
        reply("@vision/node/a", b"nonsense"),
        reply("@vision/node/a", own.to_bytes()),
    ]
    assert list(_of_their_nodes(replies, NodeDescription)) == [own]


async def test_a_node_that_was_left_out_is_found_without_a_page(monkeypatch):
    monkeypatch.setattr(monitor, "TICK_S", 0.001)
    asked: list[str] = []
    late = description(node="late")

    async def ask(key: str, **_options: object) -> Replies:
        asked.append(key)
        found = key == "@vision/node/*" and len(asked) > 2
        return Replies([reply("@vision/node/late", late.to_bytes())] if found else [])

    loop = asyncio.get_running_loop()
    network: Any = SimpleNamespace(loop=loop, ask=ask, do=lambda work: None)
    system = SystemState("vision", lambda text, replaces: None)
    system.take("late", True)
    for number in range(MAX_NODES):
        system.take(f"n{number}", True)
    assert system.fleet.node("late") is None
    monkeypatch.setattr(system.fleet, "to_ask", lambda at_ns, again_s: [])
    task = asyncio.create_task(SystemMonitor(system, network).run())
    async with asyncio.timeout(DEADLINE_S):
        while system.fleet.node("late") is None:
            await asyncio.sleep(0)
    task.cancel()
    node = system.fleet.node("late")
    assert node is not None
    assert (node.alive, node.answered) == (True, True)


async def test_descriptions_that_are_refused_do_not_stop_the_others():
    endless = description(node="b", publishes=tuple(f"{n}".zfill(400) for n in range(256)))
    replies = Replies(
        [
            reply("@vision/node/b", endless.to_bytes()),
            reply("@vision/node/a", description(node="a").to_bytes()),
        ]
    )
    replies.left_out = 3
    said: list[str] = []

    async def ask(key: str, **_options: object) -> Replies:
        return replies if key.startswith("@vision/node/") else Replies()

    network: Any = SimpleNamespace(loop=asyncio.get_running_loop(), ask=ask)
    system = SystemState("vision", lambda text, replaces: said.append(text))
    system.take("a", True)
    system.take("b", True)
    await SystemMonitor(system, network)._learn("*")
    nodes = {node.name: node.answered for node in system.fleet.nodes()}
    assert nodes == {"a": True, "b": False}
    assert [text for text in said if "some replies are left out" in text]


@pytest.mark.parametrize(
    "cut",
    [{"left_out": 1}, {"timed_out": True}, {}],
    ids=["some left out", "timed out", "complete"],
)
async def test_a_stream_is_gone_only_if_a_complete_list_lacks_it(cut: dict[str, Any]):
    sources = b'{"clients": ["ab"], "peers": []}'
    router = Replies([reply("@/f0/router", b'{"sessions": [{"peer": "ab"}]}')])
    keys = ["vision/a/image", "vision/b/image"]
    lists = [
        Replies(reply(f"@/f0/router/publisher/{key}", sources) for key in listed)
        for listed in (keys, keys[:1])
    ]
    vars(lists[1]).update(cut)

    async def ask(key: str, **_options: object) -> Replies:
        return router if key.endswith("/router") else lists.pop(0)

    network: Any = SimpleNamespace(loop=asyncio.get_running_loop(), ask=ask)
    system = SystemState("vision", lambda text, replaces: None)
    watching = SystemMonitor(system, network)
    for _ in range(2):  # a list is asked for when the sessions are the same at two looks
        await watching._learn_publishers()
        watching._list_again_s = 0.0
        await watching._learn_publishers()
    assert lists == []
    assert system.streams == (keys if cut else keys[:1])


async def test_publishers_are_asked_for_only_when_sessions_have_changed_and_none_does_now():
    asked: list[str] = []
    now = {"ab"}

    async def ask(key: str, **_options: object) -> Replies:
        if key.endswith("/router"):
            said = json.dumps({"sessions": [{"peer": each} for each in now]}).encode()
            return Replies([reply("@/f0/router", said)])
        asked.append(key)
        return Replies()

    network: Any = SimpleNamespace(loop=asyncio.get_running_loop(), ask=ask)
    watching = SystemMonitor(SystemState("vision", lambda text, replaces: None), network)
    for come, count in (("ab", 0), ("ab", 1), ("ab", 1), ("cd", 1), ("ef", 1), ("ef", 2)):
        now.add(come)
        await watching._learn_publishers()
        assert len(asked) == count
    assert set(asked) == {"@/*/router/publisher/vision/**"}


@pytest.mark.parametrize(
    ("expected", "right"), [({}, True), ({"low": 4.0}, True), ({"low": 5.0}, False)]
)
def test_a_change_of_a_value_that_another_has_changed_is_refused_and_not_sent(expected, right):
    low = Parameter(node="edge", name="low", type="float", value=4.0, default=4.0, revision=0)
    found = ParameterList(node="edge", revision=0, parameters=(low,))
    sent: list[bytes | None] = []

    async def ask(key: str, *, payload: bytes | None = None, **_options: object) -> Replies:
        sent.append(payload)
        return Replies([reply("@vision/param/edge", found.to_bytes())])

    async def change() -> None:
        network: Any = SimpleNamespace(loop=asyncio.get_running_loop(), ask=ask)
        watching = SystemMonitor(SystemState("vision", lambda text, replaces: None), network)
        await watching.set("edge", {"low": 9.0}, expected)

    if right:
        asyncio.run(change())
        assert sent[-1] == msgpack.packb({"low": 9.0})
    else:
        with pytest.raises(ParameterRefused, match="low of edge was changed meanwhile"):
            asyncio.run(change())
        assert sent == [None]


def test_a_query_without_a_session_is_known_to_be_incomplete():
    async def ask() -> Replies:
        network = Network(asyncio.get_running_loop())
        try:
            return await network.ask("@/*/router")
        finally:
            network.close()

    found = asyncio.run(ask())
    assert (list(found), found.timed_out) == ([], True)
