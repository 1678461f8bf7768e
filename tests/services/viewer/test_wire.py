"""What pages get, by its bytes."""

import json
import struct

import msgpack
import pytest

from common.errors import PayloadError
from common.messages import Header
from services.viewer import wire
from services.viewer.messages import message_text
from services.viewer.outbox import MAX_TEXTS, Outbox
from services.viewer.requests import Malformed, Set, Watch, request_of

HEADER = Header(
    camera="front", epoch=1790000000123456789, seq=7, stamp_ns=1790000000200000000,
    width=640, height=480, encoding="bgr8", node="camera_front",
)  # fmt: skip


def test_a_picture_is_a_length_a_head_and_the_bytes():
    picture = wire.Picture("vision/front/image", HEADER, b"JPEG", "image/jpeg", 320, 240, 3, 0)
    data = picture.to_page(HEADER.stamp_ns + 4_210_000, skipped=2, lost=1)
    (length,) = struct.unpack("<I", data[:4])
    head = json.loads(data[4 : 4 + length])
    assert data[4 + length :] == b"JPEG"
    assert head.pop("header") == {
        "camera": "front", "epoch": "1790000000123456789", "seq": 7,
        "stamp_ns": "1790000000200000000", "width": 640, "height": 480, "encoding": "bgr8",
        "node": "camera_front", "revision": 0,
    }  # fmt: skip
    assert head == {
        "key": "vision/front/image", "mime": "image/jpeg", "bytes": 4, "width": 320,
        "height": 240, "age_ms": 4.21, "skipped": 2, "lost": 1,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        ({"a_ns": 5, "epoch": 6, "seq": 7}, {"a_ns": "5", "epoch": "6", "seq": 7}),
        ({"area": 2**53 - 1}, {"area": 2**53 - 1}),
        ({"id": 2**53}, {"id": str(2**53)}),
        ({"id": -(2**60)}, {"id": str(-(2**60))}),
        ({"x": float("nan"), "y": float("inf")}, {"x": None, "y": None}),
        ({"on": True, "none": None}, {"on": True, "none": None}),
        ({"box": (1, 2, 2**60)}, {"box": [1, 2, str(2**60)]}),
        ({"raw": b"abc"}, {"raw": "3 bytes"}),
    ],
)
def test_numbers_survive_javascript(value, plain):
    assert wire.plain(value) == plain


FRAME = {
    "camera": "front", "epoch": 5, "seq": 1, "stamp_ns": 9, "width": 64, "height": 48,
}  # fmt: skip
CENTROID = {"header": FRAME, "x": 3, "y": 4, "box": (1, 2, 5, 6), "area": 30.0}
TRACK = {"id": 1, "state": "confirmed", "x": 3.0, "y": 4.0, "box": (1, 2, 5, 6), "area": 30.0}
TRACKS = {"header": FRAME, "tracks": (TRACK,)}


def test_a_message_is_told_with_header_and_body_apart():
    fields = CENTROID | {"more": 2**60}
    text, stamp_ns = message_text("vision/front/centroid", msgpack.packb(fields))
    assert json.loads(text) == {
        "op": "message",
        "key": "vision/front/centroid",
        "header": FRAME | {"epoch": "5", "stamp_ns": "9"},
        "body": {"x": 3, "y": 4, "box": [1, 2, 5, 6], "area": 30.0, "more": str(2**60)},
    }
    assert stamp_ns == 9


@pytest.mark.parametrize("payload", [b"", b"\xc1", msgpack.packb(5), msgpack.packb([1])])
def test_what_is_no_message_is_refused(payload):
    with pytest.raises(PayloadError, match="bad_message"):
        message_text("vision/front/centroid", payload)


@pytest.mark.parametrize(
    ("topic", "encoding", "fields"),
    [
        ("centroid", "", CENTROID | {"box": 5}),
        ("centroid", "", CENTROID | {"box": (1, 2, 3)}),
        ("centroid", "", CENTROID | {"x": "3"}),
        ("centroid", "", CENTROID | {"header": None}),
        ("centroid", "", {"header": FRAME}),
        ("centroid", "", CENTROID | {"header": FRAME | {"stamp_ns": "9"}}),
        ("centroid", "application/msgpack;vision.Else.v1", CENTROID | {"box": 5}),
        ("tracks", "", TRACKS | {"tracks": (None,)}),
        ("tracks", "", TRACKS | {"tracks": (TRACK | {"box": None},)}),
        ("truth", "", CENTROID),
        ("events", "", CENTROID),
        ("camera_info", "", CENTROID),
        ("another", "application/msgpack;vision.Tracks.v1", {"header": FRAME, "tracks": 5}),
    ],
)
def test_what_is_no_message_of_its_class_is_refused(topic, encoding, fields):
    with pytest.raises(PayloadError, match="bad_message"):
        message_text(f"vision/front/{topic}", msgpack.packb(fields), encoding)


@pytest.mark.parametrize(
    ("topic", "encoding", "fields"),
    [
        ("centroid", "", CENTROID | dict.fromkeys(("x", "y", "box", "area"))),
        ("centroid", "application/msgpack;vision.Tracks.v1", CENTROID),  # the table knows better
        ("truth", "", TRACKS),
        ("another", "application/msgpack;vision.Tracks.v1", TRACKS),
        ("another", "application/msgpack;robot.Speed.v1", {"tracks": 5}),
        ("another", "zenoh/bytes", {"header": 5}),
        ("another", "", {}),
    ],
)
def test_messages_of_their_class_and_of_anothers_pass(topic, encoding, fields):
    text, _ = message_text(f"vision/front/{topic}", msgpack.packb(fields), encoding)
    assert json.loads(text)["key"] == f"vision/front/{topic}"


def test_a_message_nested_deeper_than_any_is_told_up_to_there():
    nested: object = 1
    for _ in range(200):
        nested = {"a": nested}
    text, _ = message_text("vision/front/x", msgpack.packb({"b": nested}))
    assert "..." in text


# What waits for a page


def test_of_what_replaces_one_another_only_the_newest_waits():
    outbox = Outbox(lambda: None)
    for number in range(5000):
        outbox.put(f"health {number}", ("health", "a"))
    outbox.put("log")
    assert not outbox.full
    assert [outbox.take(), outbox.take(), outbox.take()] == ["health 4999", "log", None]


def test_a_page_that_reads_nothing_is_known_by_what_waits():
    outbox = Outbox(lambda: None)
    for number in range(MAX_TEXTS + 1):
        outbox.put(f"log {number}")
    assert outbox.full


# What a page may ask


def test_a_watch_without_size_wants_the_original():
    watch = request_of('{"op":"watch","key":"vision/front/image/compressed"}')
    assert isinstance(watch, Watch)
    assert watch.form.leaves("image/jpeg", 640, 480)
    small = request_of('{"op":"watch","key":"k","width":320,"height":320}')
    assert isinstance(small, Watch)
    assert small.form.size(640, 480) == (320, 240)


def test_values_keep_their_types():
    asked = request_of('{"op":"set","id":1,"node":"edge_front","values":{"low":5,"l2":true}}')
    assert isinstance(asked, Set)
    assert asked.values == {"low": 5, "l2": True}
    assert type(asked.values["low"]) is int


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "5", "null", '{"op":"no"}', '{"op":"watch"}', '{"op":"watch","key":5}',
        '{"op":"watch","key":"k","width":0}', '{"op":"watch","key":"k","width":"3"}',
        '{"op":"watch","key":"k","quality":101}', '{"op":"set","id":1,"node":"a/b","values":{}}',
        '{"op":"set","id":1,"node":"edge","values":{}}', "[" * 5000,
        '{"op":"set","id":1,"node":"edge","values":{"a":[1]}}',
        '{"op":"set","id":-1,"node":"edge","values":{"a":1}}',
        '{"op":"set","id":1,"node":"edge","values":{"a":NaN}}',
        '{"op":"shown"}', '{"op":"unwatch","key":""}',
    ],
)  # fmt: skip
def test_a_request_that_makes_no_sense_is_refused_in_a_line(text):
    with pytest.raises(Malformed) as refused:
        request_of(text)
    assert 0 < len(str(refused.value)) < 300
