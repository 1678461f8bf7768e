"""What nodes answer about messages of their own: taken if it is one clear schema, else said."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace
from typing import Any, ClassVar

import msgpack
import pytest

from zenoh_vision.errors import ConfigurationError, PayloadError
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Stamped
from zenoh_vision.transport.query import Query, Reply
from zv.tools.doctor.messages import error_in
from zv.tools.shared import message_types
from zv.tools.shared.discovery import Discovery
from zv.tools.shared.message_types import (
    MAX_COLUMNS,
    MAX_TYPES,
    Answers,
    answers_of,
    foreign_type,
    keys_by_schema,
    known_type,
    type_named,
)

NOTHING = Answers({}, {}, {})


class Brightness(Stamped):
    """Mean grey level."""

    schema_name: ClassVar[str] = "my.Brightness.v1"

    mean: float


class Plain(Message):
    schema_name: ClassVar[str] = "my.Plain.v1"

    n: int


def text(message: type[Message]) -> bytes:
    return json.dumps(message.model_json_schema()).encode()


def reply(name: str, payload: bytes, session: str = "1") -> Reply:
    """Return a stand-in for a reply of a node, as it comes from Zenoh."""
    sample: Any = SimpleNamespace(
        key_expr=f"@vision/schema/{name}", payload=SimpleNamespace(to_bytes=lambda: payload)
    )
    return Reply(sample, None, session, 0, 0)


def test_a_type_of_a_node_has_fields_header_and_meaning_of_its_class():
    answers = answers_of(
        [
            reply("Brightness", text(Brightness)),
            reply("my.Brightness.v1", text(Brightness)),
            reply("my.Brightness.v1", text(Brightness), session="2"),
            reply("vision.Centroid.v1", b"never read: it is known"),
        ]
    )
    assert answers.problems == {}
    assert answers.sessions == {"my.Brightness.v1": {"1", "2"}}
    for name in ("brightness", "my.brightness.V1"):
        found = type_named(name, lambda: answers)
        assert (found.schema_name, found.short_name) == ("my.Brightness.v1", "Brightness")
        assert (found.fields, found.stamped) == (("header", "mean"), True)
        assert found.meaning == "Mean grey level."
    assert found.columns(header=False) == ["mean"]
    assert found.columns(header=True)[:4] == [
        "header.camera",
        "header.epoch",
        "header.seq",
        "header.stamp_ns",
    ]
    assert found.columns(header=True)[-1] == "mean"


class Pose(Message):
    x: float
    y: float


class Robot(Message):
    schema_name: ClassVar[str] = "my.Robot.v1"

    at: Pose
    goal: Pose | None = None
    route: tuple[Pose, ...] = ()


def test_the_fields_of_a_map_have_columns_of_their_own_even_if_it_may_be_nil():
    found = foreign_type("my.Robot.v1", text(Robot))
    assert found.columns(header=True) == ["at.x", "at.y", "goal.x", "goal.y", "route"]


def test_the_columns_of_a_hostile_schema_are_bounded():
    wide = {"$ref": "#/$defs/D"}
    properties = {f"a{n}": wide for n in range(12)}
    schema = {"$defs": {"D": {"properties": {f"b{n}": wide for n in range(90)}}}}
    found = foreign_type("my.Wide.v1", json.dumps(schema | {"properties": properties}).encode())
    assert len(found.columns(header=True)) == MAX_COLUMNS
    odd = {"properties": {"a": {"const": 1, "anyOf": 3}, "b": {"properties": {}}, "header": True}}
    found = foreign_type("my.Odd.v1", json.dumps(odd).encode())
    assert found.columns(header=True) == ["a", "b", "header"]


def test_a_message_without_a_header_is_not_stamped():
    found = foreign_type("my.Plain.v1", text(Plain))
    assert (found.stamped, found.columns(header=True)) == (False, ["n"])
    assert found.checked({"n": 3}) == {"n": 3}
    with pytest.raises(PayloadError, match=r"Plain\.n: 'x' is not of type 'integer'"):
        found.checked({"n": "x"})


def test_two_schemas_of_one_name_are_a_problem_and_neither_is_taken():
    answers = answers_of([reply("my.A.v1", text(Brightness)), reply("my.A.v1", text(Plain), "2")])
    assert answers.types == {}
    with pytest.raises(ConfigurationError, match=r"2 different schemas of my\.A\.v1"):
        type_named("A", lambda: answers)


def test_a_broken_schema_hides_no_usable_one_and_alone_is_a_problem():
    replies = [reply("my.Plain.v1", b"\x1b[2J"), reply("my.Plain.v1", text(Plain), "2")]
    assert type_named("Plain", lambda: answers_of(replies)).fields == ("n",)
    with pytest.raises(ConfigurationError) as caught:
        type_named("Plain", lambda: answers_of(replies[:1]))
    assert "the schema of my.Plain.v1 cannot be used: it is not JSON" in str(caught.value)
    assert "\x1b" not in str(caught.value)


def test_names_that_are_no_schema_names_and_too_many_are_left_out():
    bad = [reply(name, text(Plain)) for name in ("my.\x1b.v1", "." * 200, "my.a b.v1", "Plain")]
    assert answers_of(bad) == NOTHING
    many = [reply(f"my.A{n}.v1", text(Plain)) for n in range(MAX_TYPES + 50)]
    assert len(answers_of(many).types) == MAX_TYPES


def test_broken_schemas_do_not_take_the_places_of_usable_ones():
    broken = [reply("my.Plain.v1", b"{" * n) for n in range(1, 5)]
    answers = answers_of([*broken, reply("my.Plain.v1", text(Plain))])
    assert (answers.types["my.Plain.v1"].fields, answers.problems) == (("n",), {})


def test_a_schema_that_proves_unusable_when_it_is_needed_is_the_error_of_the_message():
    answers = answers_of([reply("my.Odd.v1", b'{"properties": {"a": {"type": "text"}}}')])
    said = r"the schema of my\.Odd\.v1 cannot be used: type = 'text'"
    with pytest.raises(PayloadError, match=said):
        type_named("Odd", lambda: answers).checked({"a": 1})
    assert re.match(said, error_in(msgpack.packb({"a": 1}), answers.types["my.Odd.v1"]))


def test_looking_up_the_types_of_keys_asks_for_no_pictures_and_keeps_few_bytes(monkeypatch):
    keys = ("vision/front/brightness", "vision/front/heat/compressed", "vision/front/compressed")
    published = Discovery((), dict.fromkeys(keys, frozenset({"1"})), {}, answered=True)
    monkeypatch.setattr(message_types, "discover", lambda _session: published)
    asked: list[Query] = []

    def ask_all(*queries: Query) -> list[list[Reply]]:
        asked.extend(queries)
        sample: Any = SimpleNamespace(encoding="application/msgpack;my.Brightness.v1")
        return [[Reply(sample, None, "1", 0, 0)] for _ in queries]

    session: Any = SimpleNamespace(namespace="vision", ask_all=ask_all)
    assert keys_by_schema(session) == {"my.Brightness.v1": ["vision/front/brightness"]}
    assert [query.key for query in asked] == ["vision/front/brightness"]
    assert asked[0].most_bytes == 8 << 20


def test_a_short_name_of_two_messages_is_ambiguous():
    answers = answers_of([reply("my.Plain.v1", text(Plain)), reply("my.Plain.v2", text(Plain))])
    with pytest.raises(ConfigurationError, match=r"several messages: my\.Plain\.v1, my\.Plain\.v2"):
        type_named("plain", lambda: answers)
    assert type_named("my.Plain.v2", lambda: answers).schema_name == "my.Plain.v2"


def test_an_unknown_name_is_told_with_the_nearest_of_all():
    answers = answers_of([reply("my.Brightness.v1", text(Brightness))])
    with pytest.raises(ConfigurationError) as caught:
        type_named("Brightnoss", lambda: answers)
    assert "did you mean Brightness?" in str(caught.value)
    assert "of running nodes my.Brightness.v1" in str(caught.value)


def test_a_name_of_this_project_asks_no_node():
    def never() -> Answers:
        raise AssertionError

    assert type_named("centroid", never).schema_name == "vision.Centroid.v1"


def test_a_known_type_checks_as_its_class_and_returns_what_is_sent():
    found = known_type(Plain)
    assert found.checked({"n": 3, "unknown": 1}) == {"n": 3}
    with pytest.raises(PayloadError, match=r"Plain\.n"):
        found.checked({"n": None})
