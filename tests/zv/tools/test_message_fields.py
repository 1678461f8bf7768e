"""Fields of samples, ours, foreign and broken ones, as values, as text and as CSV."""

from __future__ import annotations

import csv
import io

import msgpack
import pytest

from tests.support.pictures.encoded import HEIGHT, STILL, WIDTH
from zv.tools.shared.message_fields import (
    NoSuchField,
    csv_line,
    fields_of,
    flat,
    lines_of,
    pick,
)
from zv.tools.shared.received import Received, header_of

HEADER = {"camera": "front", "epoch": 5, "seq": 7, "stamp_ns": 9, "width": 8, "height": 6}


def sample(encoding: str, payload: bytes | None, attachment: bytes | None = None) -> Received:
    return Received("a/b/c", encoding, attachment, payload, len(payload or b""))


def test_a_message_is_its_fields():
    body = {"x": 1, "box": [1, 2], "header": HEADER}
    received = sample("application/msgpack;vision.Centroid.v1", msgpack.packb(body))
    assert fields_of(received) == body
    assert fields_of(received, header=False) == {"x": 1, "box": [1, 2]}


@pytest.mark.parametrize(
    ("mime", "name"),
    [
        ("image/jpeg", "jpeg"),
        ("application/octet-stream;vision.Image.v1", "raw"),
        ("application/octet-stream;vision.Bits.v1", "bits"),
    ],
)
def test_a_picture_is_its_header_format_and_size_without_its_bytes(mime, name):
    found = fields_of(
        Received("k", mime, msgpack.packb({**HEADER, "encoding": "bgr8"}), None, 1234)
    )
    assert found == {
        "header": {**HEADER, "encoding": "bgr8"},
        "format": name,
        "width": 8,
        "height": 6,
        "encoding": "bgr8",
        "bytes": 1234,
    }


def test_a_picture_without_a_header_has_the_size_that_it_states_itself():
    found = fields_of(sample("image/jpeg", STILL))
    assert (found["width"], found["height"], "header" in found) == (WIDTH, HEIGHT, False)


@pytest.mark.parametrize(
    ("encoding", "payload", "fields"),
    [
        ("text/plain", b"hello", {"text": "hello"}),
        ("zenoh/string", b"\xff", {"text": "\ufffd"}),
        ("application/json", b'{"a": [1, NaN]}', {"a": [1, None]}),
        ("application/json", b"[1]", {"value": [1]}),
        ("application/json", b"{", {"value": "{"}),
        ("zenoh/bytes", b"\x00\x01", {"encoding": "zenoh/bytes", "bytes": 2}),
        ("zenoh/bytes", msgpack.packb({"x": b"12", 3: float("inf")}), None),
        ("application/msgpack", b"\xc1", {"unreadable": "not msgpack: FormatError", "bytes": 1}),
        ("application/msgpack", msgpack.packb(3), {"value": 3}),
    ],
)
def test_what_others_send_is_shown_as_far_as_it_can_be(encoding, payload, fields):
    found = fields_of(sample(encoding, payload))
    if fields is None:  # a map with a key that is no text is not ours, and so only counted
        fields = {"encoding": encoding, "bytes": len(payload)}
    assert found == fields


def test_what_is_nested_deep_is_cut_off_before_anything_breaks():
    deep = b"\x81\xa1a" * 900 + b"\xc0"
    found = fields_of(sample("application/msgpack;x.Y.v1", deep))
    assert "..." in str(found)
    nested_json = b"[" * 60_000 + b"]" * 60_000
    assert fields_of(sample("application/json", nested_json)) is not None


def test_a_header_is_read_from_an_attachment():
    found = header_of(msgpack.packb(HEADER | {"node": "camera_front", "later": "field"}))
    assert (found.node, found.camera, found.epoch, found.seq) == ("camera_front", "front", 5, 7)


@pytest.mark.parametrize(
    "attachment",
    [
        None,
        b"",
        b"\xc1",
        b"text",
        msgpack.packb([1, 2]),
        msgpack.packb({"camera": "front"}),
        msgpack.packb(HEADER | {"seq": -1}),
        msgpack.packb(HEADER | {"seq": "7"}),
        msgpack.packb(HEADER | {"seq": True}),
        msgpack.packb(HEADER | {"epoch": 1.5}),
        msgpack.packb(HEADER | {"camera": None}),
        msgpack.packb(HEADER | {"more": "x" * 5000}),
        b"\x81" * 4000,
        b"\x81\xa4node" + b"\x91" * 900 + b"\xc0",
    ],
    ids=range(14),
)
def test_an_attachment_that_is_no_header_is_left_out(attachment):
    assert header_of(attachment) is None


# Fields as text

MESSAGE = {
    "header": {"camera": "front", "seq": 7},
    "x": 3,
    "box": [1, 2, 30, 40],
    "world": None,
    "tracks": [{"id": 1, "v": [0.5, 1.0]}, {"id": 4, "v": []}],
    "counters": {"dropped.stale": 9, "pending": 0},
}


def test_fields_are_shown_one_a_line_and_nested_ones_indented():
    assert list(lines_of(MESSAGE)) == [
        "header:",
        "  camera: front",
        "  seq: 7",
        "x: 3",
        "box: [1, 2, 30, 40]",
        "world: null",
        "tracks:",
        "  - id: 1",
        "    v: [0.5, 1.0]",
        "  - id: 4",
        "    v: []",
        "counters:",
        "  dropped.stale: 9",
        "  pending: 0",
    ]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("x", 3),
        ("header.seq", 7),
        ("box.2", 30),
        ("tracks.id", [1, 4]),
        ("tracks.0.v.1", 1.0),
        ("counters.dropped.stale", 9),
        ("world.x", None),
    ],
)
def test_a_field_is_found_by_its_dotted_name(path, value):
    assert pick(MESSAGE, path.split(".")) == value


@pytest.mark.parametrize(
    ("path", "known"),
    [
        ("y", list(MESSAGE)),
        ("header.sequence", ["camera", "seq"]),
        ("box.4", ["0 to 3"]),
        ("tracks.name", ["id", "v"]),
        ("x.y", ["none: it is 3"]),
    ],
)
def test_a_field_that_is_not_there_names_those_that_are(path, known):
    with pytest.raises(NoSuchField) as caught:
        pick(MESSAGE, path.split("."))
    assert list(caught.value.args) == known


def test_flat_fields_have_dotted_names():
    assert flat({"a": {"b": {"c": 1}, "d": [2, 3]}, "e": None}) == {
        "a.b.c": 1,
        "a.d": [2, 3],
        "e": None,
    }


def test_a_line_of_values_is_what_a_reader_of_csv_understands():
    line = csv_line([1, None, "a,b", 'say "x"', [1, 2], 0.5])
    assert next(csv.reader(io.StringIO(line))) == ["1", "", "a,b", 'say "x"', "[1, 2]", "0.5"]
