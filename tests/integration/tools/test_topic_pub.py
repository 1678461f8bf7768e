"""``zv topic pub``: what is sent is what was given, under a header of its own."""

from __future__ import annotations

import json
import time
from pathlib import Path

import msgpack
import pytest
import zenoh

from common.errors import ConfigurationError
from services.tools.topic.options import (
    PubOptions,
)
from tests.integration.listening import Listener
from tests.integration.pictures import HEIGHT, STILL, WIDTH
from tests.integration.tools.streams import (
    CENTROID,
    JPEG,
    header,
)

KEY = "vision/c/centroid"


def test_pub_sends_messages_at_a_rate_each_under_a_header_of_its_own(client, zv, capsys):
    listener = Listener(client, KEY)
    data = json.dumps({"x": 1, "y": 2, "box": None, "area": None})
    before_ns = time.time_ns()
    zv(PubOptions(key=KEY, data=data, rate=50, count=4, size="64x48"))
    messages = listener.wait_for(4)
    headers = [message.header for message in messages]
    assert [each["seq"] for each in headers] == [0, 1, 2, 3]
    assert len({each["epoch"] for each in headers}) == 1
    stamps = [each["stamp_ns"] for each in headers]
    assert stamps == sorted(stamps)
    assert before_ns <= stamps[0]
    assert stamps[-1] - stamps[0] >= 55_000_000  # three periods of 20 ms, less what timers do
    assert {message.encoding for message in messages} == {CENTROID}
    assert all(message.body["header"] == message.header for message in messages)


def test_pub_takes_the_frame_size_from_the_newest_picture_of_the_camera(client, zv):
    def answer(query: zenoh.Query) -> None:
        with query:
            attachment = msgpack.packb(header(1, width=800, height=600))
            query.reply("vision/c/image/compressed", STILL, encoding=JPEG, attachment=attachment)

    data = json.dumps({"x": 1, "y": 2, "box": None, "area": None})
    with pytest.raises(ConfigurationError, match="--size"):
        zv(PubOptions(key=KEY, data=data))
    queryable = client.declare_queryable("vision/c/image/compressed", answer)
    listener = Listener(client, KEY)
    zv(PubOptions(key=KEY, data=data))
    (message,) = listener.wait_for(1)
    assert (message.header["width"], message.header["height"]) == (800, 600)
    queryable.undeclare()


def test_pub_sends_an_image_file_byte_by_byte(client, zv, tmp_path: Path):
    (tmp_path / "still.jpg").write_bytes(STILL)
    listener = Listener(client, "vision/c/image/compressed")
    zv(PubOptions(key="vision/c/image/compressed", data=str(tmp_path / "still.jpg")))
    (message,) = listener.wait_for(1)
    assert (message.payload, message.encoding) == (STILL, JPEG)
    assert (message.header["width"], message.header["height"]) == (WIDTH, HEIGHT)


@pytest.mark.parametrize("key", ["vision/*/centroid", "vision/**"])
def test_pub_on_many_keys_at_once_is_wrong_use(zv, key):
    with pytest.raises(ConfigurationError, match=r"without \* and \*\*"):
        zv(PubOptions(key=key, data="{}"))
