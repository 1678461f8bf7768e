"""``zv topic pub``: what is sent is what was given, under a header of its own."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path

import msgpack
import numpy as np
import pytest
import zenoh
from pydantic import ValidationError

from tests.support.listening import Listener, known_queryable, open_client
from tests.support.pictures.encoded import HEIGHT, STILL, WIDTH, jpeg
from tests.support.processes import run_program
from tests.support.publishing import (
    CENTROID,
    JPEG,
    header,
)
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.errors import ConfigurationError
from zv.tools.topic import pub
from zv.tools.topic.options import (
    PubOptions,
)

KEY = "vision/c/centroid"


def test_pub_sends_messages_at_a_rate_each_under_a_header_of_its_own(client, zv, capsys):
    listener = Listener(client, KEY)
    data = json.dumps({"x": 1, "y": 2, "box": None, "area": None})
    before_ns = time.time_ns()
    began_s = time.monotonic()
    zv(PubOptions(key=KEY, data=data, rate=50, count=4, size="64x48"))
    assert time.monotonic() - began_s >= 0.06  # three periods of 20 ms
    messages = listener.wait_for(4)
    headers = [message.header for message in messages]
    assert [each["seq"] for each in headers] == [0, 1, 2, 3]
    assert len({each["epoch"] for each in headers}) == 1
    stamps = [each["stamp_ns"] for each in headers]
    assert stamps == sorted(stamps)
    assert before_ns <= stamps[0]
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
    queryable = known_queryable(client, "vision/c/image/compressed", answer)
    listener = Listener(client, KEY)
    zv(PubOptions(key=KEY, data=data))
    (message,) = listener.wait_for(1)
    assert (message.header["width"], message.header["height"]) == (800, 600)
    queryable.undeclare()


def test_pub_says_that_the_size_is_unknown_on_a_key_that_names_no_camera(zv):
    data = json.dumps({"header": {"camera": "c"}, "x": 1, "y": 2, "box": None, "area": None})
    with pytest.raises(ConfigurationError, match="no camera answers on vision/c/image/compressed"):
        zv(PubOptions(key="centroids", data=data, type_="Centroid"))


def test_pub_sends_an_image_file_byte_by_byte(client, zv, tmp_path: Path):
    (tmp_path / "still.jpg").write_bytes(STILL)
    listener = Listener(client, "vision/c/image/compressed")
    zv(PubOptions(key="vision/c/image/compressed", data=str(tmp_path / "still.jpg")))
    (message,) = listener.wait_for(1)
    assert (message.payload, message.encoding) == (STILL, JPEG)
    assert (message.header["width"], message.header["height"]) == (WIDTH, HEIGHT)


def test_pub_waits_for_a_subscriber_that_comes_a_little_later(client, zv, monkeypatch):
    monkeypatch.setattr(pub, "MATCH_S", DEADLINE_S)  # a busy machine is late by more than 1 s
    listeners: list[Listener] = []
    later = threading.Timer(0.3, lambda: listeners.append(Listener(client, "other/late")))
    later.start()
    zv(PubOptions(key="other/late", data='{"error": "x", "allowed": "y"}', type_="refusal"))
    later.join()
    assert listeners[0].wait_for(1)


def test_pub_waits_for_as_many_subscribers_as_it_is_told_to(client, endpoint, zv, capsys):
    key, listeners = "other/several", [Listener(client, "other/several")]
    with open_client(endpoint) as another:
        later = threading.Timer(0.5, lambda: listeners.append(Listener(another, key)))
        later.start()
        data = '{"error": "x", "allowed": "y"}'
        zv(PubOptions(key=key, data=data, type_="refusal", wait_for=2))
        later.join()
        for listener in listeners:
            assert listener.wait_for(1)
    assert f"waiting for 2 subscribers on {key}; there are 1" in capsys.readouterr().err


def test_pub_once_sends_one_message_however_late_its_subscriber_comes(
    client, zv, monkeypatch, capsys
):
    monkeypatch.setattr(pub, "MATCH_S", 0.0)  # what is sent without a subscriber is sent at once
    listeners: list[Listener] = []
    later = threading.Timer(0.5, lambda: listeners.append(Listener(client, "other/once")))
    later.start()
    zv(
        PubOptions(
            key="other/once", data='{"error": "x", "allowed": "y"}', type_="refusal", once=True
        )
    )
    later.join()
    assert len(listeners[0].wait_for(1)) == 1
    assert "waiting for a subscriber on other/once\n" in capsys.readouterr().err


def test_pub_takes_the_letter_of_ros_for_once():
    # Refused for the reason that --once gives, so -1 is --once.
    done = run_program([sys.executable, "-m", "zv", "topic", "pub", "-1", "a/b", "{}", "--rate=5"])
    assert done.returncode == 2
    assert "--once sends one message" in done.stderr


@pytest.mark.parametrize("other", [{"rate": 10}, {"count": 2}, {"count": 1}])
def test_pub_once_takes_no_other_number_of_messages(other):
    with pytest.raises(ValidationError, match="--once sends one message"):
        PubOptions(key=KEY, data="{}", once=True, **other)


@pytest.mark.parametrize("count", [1, 3])
def test_the_last_picture_arrives_however_large_it_is(client, zv, tmp_path: Path, count):
    noise = np.random.default_rng(1).integers(0, 255, (1080, 1920, 3), np.uint8)
    (tmp_path / "large.jpg").write_bytes(jpeg(noise, 95))
    assert (tmp_path / "large.jpg").stat().st_size > 2 << 20
    key = "vision/c/image/compressed"
    listener = Listener(client, key)
    zv(PubOptions(key=key, data=str(tmp_path / "large.jpg"), rate=10, count=count))
    wait_until(lambda: count - 1 in [message.header["seq"] for message in listener.messages])


def test_pub_without_a_subscriber_sends_and_says_so(zv, capsys):
    data = json.dumps({"x": 1, "y": 2, "box": None, "area": None})
    zv(PubOptions(key="vision/nobody/centroid", data=data, size="64x48"))
    said = capsys.readouterr().err
    assert "no subscriber on vision/nobody/centroid within 1 s" in said
    assert "sent 1 on vision/nobody/centroid" in said


@pytest.mark.parametrize("key", ["vision/*/centroid", "vision/**"])
def test_pub_on_many_keys_at_once_is_wrong_use(zv, key):
    with pytest.raises(ConfigurationError, match=r"without \* and \*\*"):
        zv(PubOptions(key=key, data="{}"))
