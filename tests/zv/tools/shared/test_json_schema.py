"""Schemas from the network: what they accept, what is said of an error, and in bounded time."""

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
from zv.tools.shared.json_schema import MAX_BYTES, UnusableSchema, parsed
from zv.tools.shared.schema_check import MAX_STEPS, SchemaCheck


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
    return not SchemaCheck(schema).error_in(tuples(fields), "Sample")


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


def test_ignored_keywords_and_tuples_change_nothing_else_of_what_jsonschema_accepts():
    text = json.dumps(Sample.model_json_schema())

    def without_patterns(part: dict[str, Any]) -> dict[str, Any]:
        return {name: each for name, each in part.items() if name != "pattern"}

    schema = json.loads(text, object_hook=without_patterns)  # which are not checked
    oracle = jsonschema.Draft202012Validator(schema)
    chance = random.Random(1)
    assert accepts(schema, GOOD)
    check = SchemaCheck(schema)
    verdicts = []
    for _ in range(1500):
        fields = mutated(GOOD, chance)
        # 3.0 is an integer by JSON Schema, not by msgpack; none is among these values.
        verdicts.append(oracle.is_valid(fields))
        assert (not check.error_in(tuples(fields), "Sample")) == verdicts[-1], fields
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
    "no such definition": ({"properties": {"a": {"$ref": "#/$defs/B"}}}, "$ref = '#/$defs/B'"),
    "no reference": ({"properties": {"a": {"$ref": {}}}}, "$ref = {}"),
    "no definitions": ({"$defs": 3, "properties": {"a": {"$ref": "#/$defs/B"}}}, "$ref"),
    "elsewhere": ({"properties": {"a": {"$ref": "http://127.0.0.1:9/a"}}}, "$ref"),
    "no schema": ({"properties": {"a": 3}}, "properties = {'a': 3}"),
    "no type": ({"properties": {"a": {"type": "text"}}}, "type = 'text' is not JSON Schema"),
    "no type of a choice": ({"properties": {
        "a": {"anyOf": [{"type": "integer"}], "type": "text"}}}, "a type in it"),
    "a number as type": ({"properties": {
        "a": {"anyOf": [{"type": "integer"}], "type": 1}}}, "a type in it"),
    "no number": ({"properties": {"b": {"type": "number", "minimum": "x"}}}, "minimum = 'x'"),
    "no length": ({"properties": {"a": {"type": "string", "maxLength": []}}}, "maxLength = []"),
    "required": ({"properties": {"a": True}, "required": 3}, "required"),
    "required of lists": ({"properties": {"a": True}, "required": [["a"]]}, "required"),
}  # fmt: skip


@pytest.mark.parametrize(("schema", "said"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_schema_is_refused_with_a_line_and_at_once(schema, said):
    text = schema if isinstance(schema, bytes) else json.dumps(schema).encode()
    begun_s = time.process_time()
    with pytest.raises(UnusableSchema) as caught:
        SchemaCheck(parsed(text)).error_in({"a": "x", "b": 7}, "A")
    assert time.process_time() - begun_s < 1.0
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert 0 < len(str(caught.value)) <= 250


def test_a_large_message_takes_bounded_time():
    schema = parsed(json.dumps(doubling(16, "prefixItems", type="array")).encode())
    begun_s = time.process_time()
    with pytest.raises(UnusableSchema, match="steps"):
        SchemaCheck(schema).error_in({"a": pairs(16)}, "A")
    assert time.process_time() - begun_s < 1.0


def test_a_schema_that_refers_to_itself_is_followed_as_deep_as_the_message():
    tree = {"properties": {"child": {"$ref": "#/$defs/Tree"}, "n": {"type": "null"}}}
    schema = {"$defs": {"Tree": tree}, "properties": {"root": {"$ref": "#/$defs/Tree"}}}
    assert accepts(schema, {"root": {"child": {"child": {"n": None}}, "n": None}})
    assert not accepts(schema, {"root": {"child": {"child": {"n": 3}}}})


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"mean": "x"}, "Sample.mean: 'x' is not of type 'number'"),
        ({"count": 1000}, "Sample.count: 1000 is greater than or equal to the maximum of 1000"),
        ({"label": ""}, "Sample.label: '' should be non-empty"),
        ({"kind": 3}, "Sample.kind: 3 is not one of ['a', 'b']"),
        ({"poses": [{"angle": 1}]}, "Sample.poses.0: 'x' is a required property"),
        ({"size": [1]}, "Sample.size: [1] is too short"),
    ],
)
def test_an_error_names_place_reason_and_value(change, error):
    found = SchemaCheck(Sample.model_json_schema()).error_in(tuples(GOOD | change), "Sample")
    assert found == error


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


def test_an_error_of_a_large_value_is_short_and_made_at_once():
    schema = {"properties": {"a": {"anyOf": [{"type": "integer"}] * 2000}}}
    large = {"b": ["x" * 1000] * 1000}
    begun_s = time.process_time()
    error = SchemaCheck(schema).error_in({"a": [large, b"y" * (8 << 20), "z" * (8 << 20)]}, "A")
    assert time.process_time() - begun_s < 1.0
    assert error.startswith("A.a: [{'b': ['xxxxx")
    assert len(error) <= 250


def test_what_cannot_be_bounded_is_not_tried():
    regex = {"type": "string", "pattern": "^(a+)+$"}
    names = {"patternProperties": {"^(a+)+$": True}, "additionalProperties": False}
    schema = {"properties": {"a": regex, "b": names, "c": {"uniqueItems": True}}}
    slow = "a" * 60 + "!"
    begun_s = time.process_time()
    assert accepts(schema, {"a": slow, "b": {slow: 1}, "c": list(range(20_000)) * 2})
    assert time.process_time() - begun_s < 1.0


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_number_is_finite(value: float):
    assert not accepts({"properties": {"a": {"type": "number"}}}, {"a": value})
