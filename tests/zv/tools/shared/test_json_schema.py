"""Schemas from the network: what they accept is what jsonschema accepts, in bounded time."""

from __future__ import annotations

import json
import random
import time
from pathlib import Path
from typing import Any, ClassVar, Literal

import jsonschema
import msgpack
import pytest
from pydantic import Field

from tests.support.processes import ROOT
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES, Stamped
from zv.tools.shared.json_schema import (
    MAX_BYTES,
    MAX_STEPS,
    UnusableSchema,
    error_in,
    parsed,
)


class Pose(Message):
    x: float
    angle: float = Field(gt=-180, le=180)


class Sample(Stamped):
    schema_name: ClassVar[str] = "my.Sample.v1"

    mean: float = Field(ge=0)
    count: int = Field(lt=1000)
    label: str | None = Field(default=None, min_length=1, max_length=5)
    kind: Literal["a", "b"] = "a"
    poses: tuple[Pose, ...] = Field(max_length=3)
    size: tuple[int, int] = (1, 1)
    extra: dict[str, int] = Field(default={})
    anything: Any = None


HEADER = {"camera": "front", "epoch": 1, "seq": 2, "stamp_ns": 3, "width": 4, "height": 5}
GOOD = {
    "header": HEADER,
    "mean": 1.5,
    "count": 3,
    "label": "abc",
    "kind": "b",
    "poses": [{"x": 1.0, "angle": 180.0}, {"x": 0.0, "angle": 0.0}],
    "size": [3, 4],
    "extra": {"a": 1},
    "anything": [1, {"b": None}],
}
WRONG = [None, True, -1, 3, 1000, 0.5, -0.5, "", "abc", "ABCDEFG", [], [1], [1, 2], {}, {"a": "b"}]


def tuples(value: object) -> Any:
    if isinstance(value, dict):
        return {name: tuples(each) for name, each in value.items()}
    return tuple(map(tuples, value)) if isinstance(value, list) else value


def accepts(schema: dict[str, Any], fields: object) -> bool:
    return not error_in(schema, tuples(fields), "Sample")


def mutated(value: Any, chance: random.Random) -> Any:
    """Return a copy of a value in which one place is something else, or missing."""
    if isinstance(value, dict) and value and chance.random() < 0.9:
        name = chance.choice(list(value))
        if chance.random() < 0.2:
            return {key: each for key, each in value.items() if key != name}
        return {**value, name: mutated(value[name], chance)}
    if isinstance(value, list) and value and chance.random() < 0.7:
        index = chance.randrange(len(value))
        return [*value[:index], mutated(value[index], chance), *value[index + 1 :]]
    return chance.choice(WRONG)


def test_what_is_accepted_is_what_jsonschema_accepts():
    text = json.dumps(Sample.model_json_schema())

    def without_patterns(part: dict[str, Any]) -> dict[str, Any]:
        return {name: each for name, each in part.items() if name != "pattern"}

    schema = json.loads(text, object_hook=without_patterns)  # which are not checked
    oracle = jsonschema.Draft202012Validator(schema)
    chance = random.Random(1)
    assert accepts(schema, GOOD)
    verdicts = []
    for _ in range(1500):
        fields = mutated(GOOD, chance)
        # 3.0 is an integer by JSON Schema, not by msgpack; none is among these values.
        verdicts.append(oracle.is_valid(fields))
        assert accepts(schema, fields) == verdicts[-1], fields
    assert 100 < sum(verdicts) < 1400  # and both verdicts occur


@pytest.mark.parametrize("name", MESSAGES)
def test_a_schema_of_this_project_accepts_the_test_vectors(name: str):
    schema = parsed(json.dumps(MESSAGES[name].model_json_schema()).encode())
    files = [json.loads(file.read_text()) for file in Path(ROOT / "tests/vectors").glob("*.json")]
    rows = [row for file in files if isinstance(file, dict) for row in file["vectors"]]
    of_name = [row for row in rows if row.get("encoding", "").endswith(f";{name}")]
    for row in of_name:
        assert accepts(schema, msgpack.unpackb(bytes.fromhex(row["bytes"]), use_list=False))
    assert of_name or name in ("vision.Header.v1", "vision.Refusal.v1", "vision.ParameterList.v1")


def doubling(levels: int, keyword: str, **also: Any) -> dict[str, Any]:
    """Return a small schema that is 2**levels large once its references are followed."""
    definitions = {
        f"D{level}": also | {keyword: [{"$ref": f"#/$defs/D{level + 1}"}] * 2}
        for level in range(levels)
    }
    definitions[f"D{levels}"] = {"type": "integer"}
    return {"$defs": definitions, "properties": {"a": {"$ref": "#/$defs/D0"}}}


def pairs(levels: int) -> Any:
    return [pairs(levels - 1)] * 2 if levels else 1


LOOP = {"$defs": {"A": {"$ref": "#/$defs/A"}}, "properties": {"a": {"$ref": "#/$defs/A"}}}
HOSTILE = {
    "no JSON": (b"{", "not JSON"),
    "no object": (b"[]", "no object with properties"),
    "no properties": (b"{}", "no object with properties"),
    "too large": (b" " * (MAX_BYTES + 1), f"at most {MAX_BYTES} are allowed"),
    "brackets": (b"[" * 60_000, "not JSON"),
    "doubling": (doubling(60, "anyOf"), f"more than {MAX_STEPS} steps"),
    "choices": ({"$defs": {"E": {"enum": [1] * 2000}}, "properties": {
        "a": {"anyOf": [{"$ref": "#/$defs/E"}] * 99}}}, "steps"),
    "loop": (LOOP, "no end"),
    "no such definition": ({"properties": {"a": {"$ref": "#/$defs/B"}}}, "does not define"),
    "no reference": ({"properties": {"a": {"$ref": {}}}}, "does not define"),
    "no definitions": ({"$defs": 3, "properties": {"a": {"$ref": "#/$defs/B"}}}, "not define"),
    "no schema": ({"properties": {"a": 3}}, "3 is no schema"),
    "no type": ({"properties": {"a": {"type": "text"}}}, "'text' is none of JSON Schema"),
    "no list": ({"properties": {"a": {"anyOf": {}}}}, "anyOf"),
    "no alternatives": ({"properties": {"a": {"anyOf": []}}}, "anyOf"),
    "no number": ({"properties": {"b": {"type": "number", "minimum": "x"}}}, "'x' is no number"),
    "no length": ({"properties": {"a": {"type": "string", "maxLength": []}}}, "[] is no number"),
    "infinite": (b'{"properties": {"b": {"type": "integer", "maximum": 1e999}}}', "no number"),
    "no choice": ({"properties": {"a": {"enum": []}}}, "enum"),
    "required": ({"properties": {"a": True}, "required": 3}, "required"),
    "required of lists": ({"properties": {"a": True}, "required": [["a"]]}, "no names"),
    "huge": ({"properties": {"b": {"type": "integer", "minimum": 10**400}}}, "no number"),
}  # fmt: skip


@pytest.mark.parametrize(("schema", "said"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_schema_is_refused_with_a_line_and_at_once(schema, said):
    text = schema if isinstance(schema, bytes) else json.dumps(schema).encode()
    begun_s = time.process_time()
    with pytest.raises(UnusableSchema) as caught:
        error_in(parsed(text), {"a": "x", "b": 7}, "A")
    assert time.process_time() - begun_s < 1.0
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert 0 < len(str(caught.value)) <= 250


def test_a_large_message_takes_bounded_time():
    schema = parsed(json.dumps(doubling(16, "prefixItems", type="array")).encode())
    begun_s = time.process_time()
    with pytest.raises(UnusableSchema, match="steps"):
        error_in(schema, {"a": pairs(16)}, "A")
    assert time.process_time() - begun_s < 1.0


def test_a_schema_that_refers_to_itself_is_followed_as_deep_as_the_message():
    tree = {"properties": {"child": {"$ref": "#/$defs/Tree"}, "n": {"type": "null"}}}
    schema = {"$defs": {"Tree": tree}, "properties": {"root": {"$ref": "#/$defs/Tree"}}}
    assert accepts(schema, {"root": {"child": {"child": {"n": None}}, "n": None}})
    assert not accepts(schema, {"root": {"child": {"child": {"n": 3}}}})


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"mean": "x"}, "Sample.mean: Input should be a valid number, got 'x'"),
        ({"count": 1000}, "Sample.count: Input should be less than 1000, got 1000"),
        ({"label": ""}, "Sample.label: Input should be of 1 to 5 items or characters, got ''"),
        ({"kind": 3}, "Sample.kind: Input should be one of ['a', 'b'], got 3"),
        ({"poses": [{"angle": 1}]}, "Sample.poses.0.x: Field required"),
        ({"size": [1]}, "Sample.size: Input should be a list of 2 items, got (1,)"),
    ],
)
def test_an_error_names_place_reason_and_value(change, error):
    assert error_in(Sample.model_json_schema(), tuples(GOOD | change), "Sample") == error


def test_names_of_fields_may_be_anything():
    schema = {
        "properties": {"model_config": {"type": "integer"}, "a b": {"type": "null"}, "": True}
    }
    assert accepts(schema, {"model_config": 3, "a b": None})
    assert not accepts(schema, {"model_config": "3"})


def test_binary_texts_may_be_bytes():
    schema = {"properties": {"a": {"type": "string", "format": "binary"}}}
    assert accepts(schema, {"a": b"\xff"})
    assert not accepts(schema, {"a": 3})
