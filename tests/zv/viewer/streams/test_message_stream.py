"""Messages as pages get them."""

import json

import msgpack
import pytest

from zenoh_vision.errors import PayloadError
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.stream.sample import Sample
from zv.viewer.streams.message_stream import MessageStream, large_text, message_text

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
        "type": "vision.Centroid.v1",
        "header": FRAME | {"epoch": "5", "stamp_ns": "9"},
        "body": {"x": 3, "y": 4, "box": [1, 2, 5, 6], "area": 30.0, "more": str(2**60)},
    }
    assert stamp_ns == 9


@pytest.mark.parametrize("part", [{}, [], [[]]])
def test_a_message_of_many_maps_and_lists_is_refused_and_one_of_many_numbers_is_not(part):
    fields = {"header": FRAME, "tracks": [], "more": [part] * 60_000}
    with pytest.raises(PayloadError, match="more than 10000 maps and lists"):
        message_text("vision/front/tracks", msgpack.packb(fields))
    message_text("vision/front/tracks", msgpack.packb({**fields, "more": [1] * 60_000}))


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


def test_what_is_too_large_or_a_deletion_does_not_wait_and_is_counted():
    counters = FrameCounters()
    stream = MessageStream(None, "vision/front/x", lambda _: None)  # type: ignore[arg-type]
    intake = stream._new_intake(Consumer(counters, lambda _: None))
    intake.receive(Sample("vision/front/x", bytes((1 << 20) + 1)))
    assert intake.take(0) is None
    assert counters.snapshot()["dropped.bad_message"] == 1
    intake.receive(Sample("vision/front/x", bytes(1 << 20)))
    assert intake.take(0) is not None
    intake.receive(Sample("vision/front/x", b"", deleted=True))
    assert counters.snapshot()["dropped.empty"] == 1


def test_of_a_message_that_is_too_large_to_be_decoded_a_page_gets_size_and_header():
    text, stamp_ns = large_text("vision/front/x", 1_000_000, msgpack.packb(FRAME))
    said = json.loads(text)
    assert (said["op"], said["key"], said["bytes"]) == ("large", "vision/front/x", 1_000_000)
    assert (said["header"]["seq"], stamp_ns) == (1, 9)
    assert json.loads(large_text("vision/front/x", 70_000, None)[0])["header"] is None
