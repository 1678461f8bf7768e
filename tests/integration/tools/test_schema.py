"""``zv schema``: what a real system sends is as the schemas say, and they say something."""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import jsonschema
import msgpack
import pytest

from tests.integration.conftest import a_router, some_services
from tests.support.listening import Listener, Message, ask, open_client, wait_for_nodes
from tests.support.processes import ROOT
from tests.support.waiting import wait_until
from zenoh_vision.messages import MESSAGES
from zenoh_vision.transport.connection import Connection
from zv.tools.schema import command as schema_tool
from zv.tools.schema.options import SchemaOptions
from zv.tools.shared.output import Output

VECTORS = ROOT / "tests" / "vectors"
TRACKERS_HEALTH = "@vision/diagnostics/tracker_front"
WANTED = {
    "vision/front/image",
    "vision/front/image/compressed",
    "vision/front/mask/compressed",
    "vision/front/truth",
    TRACKERS_HEALTH,
}


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, list[Message]]]:
    """What a camera and its tracker sent and answered, by key."""
    folder = tmp_path_factory.mktemp("system")
    with (
        a_router(folder) as router,
        some_services(router.endpoint, folder) as start,
        open_client(router.endpoint) as client,
    ):
        data, health = Listener(client, "vision/**"), Listener(client, "@vision/diagnostics/*")
        start("camera", "--width", 320, "--height", 240)
        start("tracker")
        wait_for_nodes(client, "camera_front", "tracker_front")

        def seen() -> bool:
            came = Counter(message.key for message in data.messages + health.messages)
            return all(came[key] >= 2 for key in WANTED) and came["vision/front/centroid"] >= 20

        wait_until(seen)
        messages = data.messages + health.messages
        messages += ask(client, "@vision/node/*")
        answers = {message.key: [message] for message in ask(client, "@vision/schema/*")}
        yield answers | {
            key: [message for message in messages if message.key == key]
            for key in {message.key for message in messages}
        }


def schema(name: str) -> dict[str, Any]:
    """Return what ``zv schema NAME`` prints."""
    with redirect_stdout(io.StringIO()) as printed:
        schema_tool.run(SchemaOptions(name=name), Connection(), Output())
    found: dict[str, Any] = json.loads(printed.getvalue())
    jsonschema.Draft202012Validator.check_schema(found)
    return found


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("Centroid", "vision/front/centroid"),
        ("vision.Tracks.v1", "vision/front/truth"),
        ("diagnostics", TRACKERS_HEALTH),
        ("Node", "@vision/node/camera_front"),
    ],
)
def test_captured_messages_are_as_their_schema_says(captured, name, key):
    validator = jsonschema.Draft202012Validator(schema(name))
    bodies = [message.body for message in captured[key]]
    assert bodies
    for body in bodies:
        validator.validate(body)
    for field in list(bodies[-1]):  # and the schema does not say yes to everything
        assert not validator.is_valid({**bodies[-1], field: {"wrong": []}}), field


def test_captured_headers_are_as_their_schema_says(captured):
    validator = jsonschema.Draft202012Validator(schema("Header"))
    with_header = [
        message
        for key, messages in captured.items()
        if key.startswith("vision/")
        for message in messages
    ]
    assert {message.key for message in with_header} >= WANTED - {TRACKERS_HEALTH}
    for message in with_header:
        validator.validate(message.header)
    assert not validator.is_valid(with_header[0].header | {"seq": -1})


@pytest.mark.parametrize("file", sorted(VECTORS.glob("*.json")), ids=lambda path: path.stem)
def test_the_test_vectors_are_as_their_schema_says(file: Path):
    validator = jsonschema.Draft202012Validator(schema(file.stem.replace("_", "")))
    rows = json.loads(file.read_text())
    rows = rows if isinstance(rows, list) else rows["vectors"]
    assert rows
    for row in rows:
        validator.validate(msgpack.unpackb(bytes.fromhex(row["bytes"])))


def test_a_node_answers_the_same_schema(captured):
    (answer,) = captured["@vision/schema/Centroid"]
    assert json.loads(answer.payload) == schema("Centroid")


def test_without_a_name_every_message_is_listed(capsys):
    schema_tool.run(SchemaOptions(), Connection(), Output(as_json=True))
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {row["schema"] for row in rows} == set(MESSAGES)
    assert all(row["keys"] and row["meaning"] for row in rows)
