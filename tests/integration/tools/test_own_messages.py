"""Messages of a user's own, with the schema that their running node answers."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from typing import Any, ClassVar

import msgpack
import pytest
import zenoh

from tests.support.diagnosing import Diagnosis
from tests.support.listening import Listener, known_queryable, wait_for_nodes
from tests.support.waiting import wait_until
from zenoh_vision import Connection, Message, Node, Stamped, message_topic
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.messages import Header
from zv.tools.schema import command as schema_tool
from zv.tools.schema.options import SchemaOptions
from zv.tools.shared.output import Output
from zv.tools.topic.options import EchoOptions, PubOptions

NAMESPACE = "vision"
KEY = "vision/front/difference"


class Limits(Message):
    low: float
    high: float


class Difference(Stamped):
    """How much a frame differs from the one before."""

    schema_name: ClassVar[str] = "my.Difference.v1"

    share: float
    where: tuple[int, int] | None = None
    limits: Limits | None = None


DIFFERENCE = message_topic("difference", Difference)


def difference(seq: int, where: tuple[int, int] | None = None) -> Difference:
    stamp_ns = time.time_ns()
    header = Header(
        camera="front", epoch=1, seq=seq, stamp_ns=stamp_ns, width=64, height=48, node="mine_front"
    )
    return Difference(header=header, share=0.5, where=where)


@pytest.fixture
def node(endpoint: str, client: zenoh.Session) -> Iterator[Node]:
    """A node of a user's own, at the router."""
    connection = Connection(endpoint, NAMESPACE)
    with Node("mine", camera="front", connection=connection, publishes=[DIFFERENCE]) as node:
        wait_for_nodes(client, "mine_front")
        yield node


@pytest.fixture
def publishing(node: Node) -> Iterator[Node]:
    """The node, which sends a message every 20 ms."""
    ended = threading.Event()

    def send() -> None:
        seq = 0
        while not ended.wait(0.02):
            node.publish(DIFFERENCE, difference(seq))
            seq += 1

    thread = threading.Thread(target=send)
    thread.start()
    yield node
    ended.set()
    thread.join()


def schema(endpoint: str, capsys, name: str | None = None, **form: bool) -> str:
    capsys.readouterr()
    options = SchemaOptions(name=name)
    schema_tool.run(options, Connection(endpoint, timeout_s=20), Output(**form))
    out: str = capsys.readouterr().out
    return out


@pytest.mark.parametrize("name", ["Difference", "my.difference.v1"])
def test_its_schema_is_printed_by_its_short_and_its_versioned_name(endpoint, node, capsys, name):
    assert json.loads(schema(endpoint, capsys, name)) == Difference.model_json_schema()


def test_echo_refuses_a_field_that_its_schema_lacks_and_names_that_alone(zv, publishing):
    options = EchoOptions(key=KEY, field=("share", "limits.low", "nope"), for_=10.0)
    with pytest.raises(ConfigurationError, match=r"^--field nope: .*my\.Difference\.v1"):
        zv(options)


def test_the_list_has_it_with_its_keys_once_it_was_sent(endpoint, node, capsys):
    node.publish(DIFFERENCE, difference(0))

    def row() -> dict[str, Any]:
        rows = map(json.loads, schema(endpoint, capsys, as_json=True).splitlines())
        return next(row for row in rows if row["name"] == "Difference")

    wait_until(lambda: row()["keys"] == [KEY])
    assert row()["schema"] == "my.Difference.v1"
    assert row()["meaning"].startswith("How much a frame")


def test_an_unknown_name_without_a_router_says_that_no_node_could_be_asked():
    connection = Connection("tcp/127.0.0.1:1", timeout_s=0.1)
    with pytest.raises(ConfigurationError) as caught:
        schema_tool.run(SchemaOptions(name="Differenze"), connection, Output())
    assert "no message 'Differenze'" in str(caught.value)
    assert "no running node could be asked: " in str(caught.value)


def pub(key: str, data: object, **options: object) -> PubOptions:
    return PubOptions(key=key, data=json.dumps(data), size="64x48", **options)


@pytest.mark.parametrize("by", ["its publisher", "its newest message", "--type"])
def test_a_message_is_sent_with_the_type_of_its_key_and_checked(zv, client, node, by):
    key, options = KEY, {}
    if by == "its newest message":
        node.publish(DIFFERENCE, difference(0))
    if by == "--type":
        key, options = "vision/front/elsewhere", {"type_": "Difference"}
    came = Listener(client, key)
    zv(pub(key, {"share": 0.25, "where": [1, 2]}, **options))
    sample = wait_until(lambda: [m for m in came.messages if m.header["node"] == "topic_pub"])[0]
    assert sample.encoding == "application/msgpack;my.Difference.v1"
    sent = Difference.from_bytes(sample.payload)
    assert (sent.share, sent.where, sent.header.camera) == (0.25, (1, 2), "front")
    with pytest.raises(ConfigurationError, match=r"Difference\.share: 'x' is not of type 'number'"):
        zv(pub(key, {"share": "x"}, **options))
    with pytest.raises(ConfigurationError, match="no field 'shares'; its fields: header, share"):
        zv(pub(key, {"shares": 1}, **options))


def test_a_key_of_which_no_node_knows_the_type_is_refused(zv, node):
    with pytest.raises(ConfigurationError, match="no running node says what it carries"):
        zv(pub("vision/front/unheard", {"share": 1}))


def test_a_schema_that_is_broken_is_one_clear_line(zv, endpoint, client, node, capsys):
    name = "@vision/schema/my.Broken.v1"
    with known_queryable(client, name, lambda query: query.reply(name, b"[" * 5000)):
        for attempt in (
            lambda: schema(endpoint, capsys, "Broken"),
            lambda: zv(pub("vision/front/any", {"a": 1}, type_="Broken")),
        ):
            with pytest.raises(ConfigurationError) as caught:
                attempt()
            assert "the schema of my.Broken.v1 cannot be used" in str(caught.value)
            assert "\n" not in str(caught.value)
        ((level, text, _),) = Diagnosis(endpoint, NAMESPACE).of("messages")
        assert level == "WARN"
        assert "the schema of my.Broken.v1 cannot be used: it is not JSON" in text


def test_the_doctor_finds_messages_that_are_not_as_their_schema_says(endpoint, client, publishing):
    wrong = difference(0).to_map() | {"share": "half\x1b[2J"}
    ended = threading.Event()

    def send() -> None:
        while not ended.wait(0.02):
            client.put(
                KEY,
                msgpack.packb(wrong),
                encoding="application/msgpack;my.Difference.v1",
                attachment=difference(0).header.model_copy(update={"node": "bad"}).to_bytes(),
            )

    def texts() -> list[tuple[str, str]]:
        found = Diagnosis(endpoint, NAMESPACE, for_s=0.3).of("messages")
        return [(level, text) for level, text, _ in found]

    ((level, text),) = texts()
    assert level == "OK"
    assert text.endswith("messages are as their schemas say: my.Difference.v1")
    thread = threading.Thread(target=send)
    thread.start()
    try:
        ((level, text),) = wait_until(lambda: [t for t in [texts()] if t[0][0] == "WARN"])[0]
    finally:
        ended.set()
        thread.join()
    assert f"messages on {KEY} are no my.Difference.v1 (sent by bad): " in text
    assert "Difference.share: 'half" in text
    assert "\x1b" not in text
