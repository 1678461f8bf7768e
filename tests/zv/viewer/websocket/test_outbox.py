"""What a page is sent: texts that wait, and pictures by their bytes."""

import asyncio
import json
import struct

from tests.support.headers import header
from zv.viewer.streams.rendering import EncodedPicture
from zv.viewer.websocket.sender import MAX_TEXTS, Outbox, picture_message

HEADER = header(7, 1790000000123456789, stamp_ns=1790000000200000000, node="camera_front")


def test_a_picture_is_a_length_a_head_and_the_bytes():
    picture = EncodedPicture("vision/front/image", HEADER, b"JPEG", "image/jpeg", 320, 240)
    data = picture_message(picture, HEADER.stamp_ns + 4_210_000, skipped=2, lost=1)
    (length,) = struct.unpack("<I", data[:4])
    head = json.loads(data[4 : 4 + length])
    assert data[4 + length :] == b"JPEG"
    assert head.pop("header") == {
        "camera": "front", "epoch": "1790000000123456789", "seq": 7,
        "stamp_ns": "1790000000200000000", "width": 64, "height": 48, "encoding": "bgr8",
        "node": "camera_front", "revision": 0,
    }  # fmt: skip
    assert head == {
        "key": "vision/front/image", "mime": "image/jpeg", "bytes": 4, "width": 320,
        "height": 240, "age_ms": 4.21, "skipped": 2, "lost": 1,
    }  # fmt: skip


def test_of_what_replaces_one_another_only_the_newest_waits():
    outbox = Outbox(asyncio.Event())
    for number in range(5000):
        outbox.put(f"health {number}", ("health", "a"))
    outbox.put("log")
    assert not outbox.full
    assert [outbox.take(), outbox.take(), outbox.take()] == ["health 4999", "log", None]


def test_a_page_that_reads_nothing_is_known_by_what_waits():
    outbox = Outbox(asyncio.Event())
    for number in range(MAX_TEXTS + 1):
        outbox.put(f"log {number}")
    assert outbox.full
