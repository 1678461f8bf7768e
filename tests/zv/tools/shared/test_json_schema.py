"""Schemas from the network: what they accept is what jsonschema accepts, at a bounded cost."""

from __future__ import annotations

import json
import random
import time
from pathlib import Path
from typing import Any, ClassVar, Literal

import jsonschema
import msgpack
import pytest
from pydantic import Field, ValidationError

from tests.support.processes import ROOT
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES, Stamped
from zv.tools.shared.json_schema import (
    MAX_ALTERNATIVES,
    MAX_BYTES,
    MAX_DEPTH,
    MAX_PARTS,
    UnusableSchema,
    parsed,
    pattern_cost,
    validator_of,
)


class Pose(Message):
    x: float
    angle: float = Field(gt=-180, le=180)


class Sample(Stamped):
    schema_name: ClassVar[str] = "my.Sample.v1"

    mean: float = Field(ge=0)
    count: int = Field(lt=1000)
    label: str | None = Field(default=None, max_length=5, pattern="^[a-z]+$")
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
    try:
        validator_of(schema).validate_python(tuples(fields), strict=True)
    except ValidationError:
        return False
    return True


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
    schema = Sample.model_json_schema()
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
    validator = validator_of(schema)
    files = [json.loads(file.read_text()) for file in Path(ROOT / "tests/vectors").glob("*.json")]
    rows = [row for file in files if isinstance(file, dict) for row in file["vectors"]]
    of_name = [row for row in rows if row.get("encoding", "").endswith(f";{name}")]
    for row in of_name:
        validator.validate_python(
            msgpack.unpackb(bytes.fromhex(row["bytes"]), use_list=False, strict_map_key=True),
            strict=True,
        )
    assert of_name or name in ("vision.Header.v1", "vision.Refusal.v1", "vision.ParameterList.v1")


def nested(levels: int) -> dict[str, Any]:
    part: dict[str, Any] = {"type": "integer"}
    for _ in range(levels):
        part = {"type": "object", "properties": {"a": part}}
    return part


def doubling(levels: int, keyword: str) -> dict[str, Any]:
    """Return a small schema that is 2**levels large once its references are followed."""
    definitions = {
        f"D{level}": {keyword: [{"$ref": f"#/$defs/D{level + 1}"}] * 2} for level in range(levels)
    }
    definitions[f"D{levels}"] = {"type": "integer"}
    return {"$defs": definitions, "properties": {"a": {"$ref": "#/$defs/D0"}}}


HOSTILE = {
    "no JSON": (b"{", "not JSON"),
    "no object": (b"[]", "no object with properties"),
    "no properties": (b"{}", "no object with properties"),
    "too large": (b" " * (MAX_BYTES + 1), f"at most {MAX_BYTES} are allowed"),
    "brackets": (b"[" * 60_000, "not JSON"),
    "too deep": (nested(MAX_DEPTH), "levels deep"),
    "too many parts": ({"properties": {str(n): True for n in range(MAX_PARTS)}}, "parts"),
    "doubling": (doubling(60, "anyOf"), "alternatives"),
    "doubling tuples": (
        {"$defs": {f"D{n}": {"type": "array", "prefixItems": [{"$ref": f"#/$defs/D{n + 1}"}] * 9}
                   for n in range(9)} | {"D9": True},
         "properties": {"a": {"$ref": "#/$defs/D0"}}},
        "parts",
    ),
    "alternatives": (
        {"properties": {"a": {"anyOf": [{"const": n} for n in range(MAX_ALTERNATIVES + 1)]}}},
        "alternatives",
    ),
    "no such definition": ({"properties": {"a": {"$ref": "#/$defs/B"}}}, "does not define"),
    "no reference": ({"properties": {"a": {"$ref": {}}}}, "does not define"),
    "no definitions": ({"$defs": 3, "properties": {"a": {"$ref": "#/$defs/B"}}}, "not define"),
    "no schema": ({"properties": {"a": 3}}, "3 is no schema"),
    "no type": ({"properties": {"a": {"type": "text"}}}, "'text' is none of JSON Schema"),
    "no list": ({"properties": {"a": {"anyOf": {}}}}, "anyOf"),
    "no alternatives": ({"properties": {"a": {"anyOf": []}}}, ""),
    "no number": ({"properties": {"a": {"type": "number", "minimum": "x"}}}, "'x' is no number"),
    "no length": ({"properties": {"a": {"type": "string", "maxLength": -1}}}, "-1 is no length"),
    "infinite": (b'{"properties": {"a": {"type": "integer", "maximum": 1e999}}}', "no number"),
    "no pattern": ({"properties": {"a": {"type": "string", "pattern": "("}}}, ""),
    "large pattern": (
        {"properties": {"a": {"type": "string", "pattern": "(\\w{99}){99}"}}}, ""
    ),
    "no choice": ({"properties": {"a": {"enum": []}}}, "enum"),
    "required": ({"properties": {"a": True}, "required": 3}, "required"),
}  # fmt: skip


@pytest.mark.parametrize(("schema", "said"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_schema_is_refused_with_a_line_and_at_once(schema, said):
    text = schema if isinstance(schema, bytes) else json.dumps(schema).encode()
    begun_s = time.process_time()
    with pytest.raises(UnusableSchema) as caught:
        validator_of(parsed(text))
    assert time.process_time() - begun_s < 1.0
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert 0 < len(str(caught.value)) <= 250


def test_a_schema_that_refers_to_itself_accepts_anything_there():
    schema = {
        "$defs": {
            "Tree": {"properties": {"child": {"$ref": "#/$defs/Tree"}, "n": {"type": "null"}}}
        },
        "properties": {"root": {"$ref": "#/$defs/Tree"}},
    }
    assert accepts(schema, {"root": {"child": {"child": 3}, "n": None}})
    assert not accepts(schema, {"root": {"n": 3}})


def test_many_patterns_cost_little_and_none_can_be_slow():
    slow = {"type": "string", "pattern": "^(a+)+$"}
    schema = {"properties": {f"f{n}": slow for n in range(500)}}
    begun_s = time.process_time()
    assert not accepts(schema, {"f0": "a" * 60_000 + "b"})
    assert time.process_time() - begun_s < 1.0


@pytest.mark.parametrize(
    "pattern",
    [r"\w{100}", r"\w" * 48, r"(?i)\w{20}", r"(?x)(\w{9}) {9}"],
)
def test_patterns_of_large_automata_are_ignored_beyond_a_cost(pattern):
    texts = [f"{pattern}|{n}" for n in range(20)]
    properties = {f"f{n}": {"type": "string", "pattern": text} for n, text in enumerate(texts)}
    begun_s = time.process_time()
    validator_of({"properties": properties})
    assert time.process_time() - begun_s < 0.5  # some 0.1 s; without the limit 0.7 to 2 s


def test_twenty_patterns_of_names_are_all_kept():
    name = {"type": "string", "pattern": "^[a-z0-9_]{1,64}$"}
    schema = {"properties": {f"f{n}": name for n in range(20)}}
    good = {f"f{n}": "front" for n in range(20)}
    assert accepts(schema, good)
    assert not accepts(schema, good | {"f19": "Front"})


@pytest.mark.parametrize(
    ("pattern", "cost"),
    [
        ("abc", 3),
        (r"\w", 2 + 100),
        ("a{3}b{2,5}", 10 * 8),
        ("(a{3}){5}", 9 * 15),
        ("a{3}{5}", 7 * 15),
        ("(?i)a", 5 + 300),
        ("a{,7}", 5 * 7),
    ],
)
def test_the_cost_of_a_pattern_counts_copies_classes_and_flags(pattern, cost):
    assert pattern_cost(pattern) == cost


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
