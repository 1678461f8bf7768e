"""The bytes of every message, as other programs see them: tests/vectors, made once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgpack
import pytest

from zenoh_vision import keys, messages
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import Message
from zenoh_vision.topics import TOPICS

FOLDER = Path(__file__).parents[1] / "vectors"
MESSAGES: dict[str, type[Message]] = {
    name: getattr(messages, name)
    for name in (
        "Header",
        "Centroid",
        "Tracks",
        "TrackEvent",
        "CameraInfo",
        "Prediction",
        "Replay",
        "Contours",
        "Diagnostics",
        "Parameter",
        "ParameterList",
        "Refusal",
        "NodeDescription",
    )
}
FILES = {
    found["message"]: found for found in map(json.loads, map(Path.read_text, FOLDER.iterdir()))
}


def rows(kind: str) -> list[Any]:
    return [
        pytest.param(MESSAGES[name], row, id=f"{name}: {row['name']}")
        for name, found in sorted(FILES.items())
        for row in found[kind]
    ]


def test_every_message_with_a_schema_name_has_vectors():
    sent = {
        name
        for name, message in vars(messages).items()
        if isinstance(message, type) and issubclass(message, Message) and message.schema_name
    }
    assert sent == set(MESSAGES) == set(FILES)


@pytest.mark.parametrize(("message", "row"), rows("vectors"))
def test_a_message_becomes_exactly_these_bytes(message: type[Message], row: dict[str, Any]):
    assert message.from_map(arrays_as_tuples(row["map"])).to_bytes().hex() == row["bytes"]


@pytest.mark.parametrize(("message", "row"), rows("vectors"))
def test_the_bytes_become_the_same_message_and_the_same_bytes(
    message: type[Message], row: dict[str, Any]
):
    payload = bytes.fromhex(row["bytes"])
    decoded = message.from_bytes(payload)
    assert decoded.to_bytes() == payload
    assert json.loads(json.dumps(decoded.to_map())) == row["map"]


@pytest.mark.parametrize(("message", "row"), rows("vectors"))
def test_a_plain_msgpack_decoder_reads_the_map(message: type[Message], row: dict[str, Any]):
    assert msgpack.unpackb(bytes.fromhex(row["bytes"])) == row["map"]


@pytest.mark.parametrize(("message", "row"), rows("vectors"))
def test_a_vector_names_the_encoding_and_a_key_of_its_message(
    message: type[Message], row: dict[str, Any]
):
    topics = {
        topic.key(keys.DEFAULT_NAMESPACE, keys.DEFAULT_CAMERA): topic.encoding
        for topic in TOPICS.values()
    }
    if message is messages.Header:  # rides on a picture
        assert topics[row["key"]] == row["encoding"] == "image/jpeg"
        return
    assert row["encoding"] == keys.msgpack_of(message.schema_name)
    if not row["key"].startswith("@"):
        assert topics[row["key"]] == row["encoding"]


@pytest.mark.parametrize(("message", "row"), rows("lenient"))
def test_other_bytes_of_the_same_meaning_are_read_too(message: type[Message], row: dict[str, Any]):
    payload = bytes.fromhex(row["bytes"])
    decoded = message.from_bytes(payload)
    assert json.loads(json.dumps(decoded.to_map())) == row["map"]
    assert decoded.to_bytes() != payload


@pytest.mark.parametrize(("message", "row"), rows("invalid"))
def test_wrong_bytes_are_refused_naming_the_field(message: type[Message], row: dict[str, Any]):
    with pytest.raises(PayloadError) as caught:
        message.from_bytes(bytes.fromhex(row["bytes"]))
    assert caught.value.reason == row["reason"]
    assert caught.value.detail.startswith((f"{message.__name__}.{row['names']}", row["names"]))


def arrays_as_tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: arrays_as_tuples(item) for key, item in value.items()}
    if isinstance(value, list):
        return tuple(arrays_as_tuples(item) for item in value)
    return value
