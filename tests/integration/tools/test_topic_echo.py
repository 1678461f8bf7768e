"""``zv topic echo``: every form of a message, and what ends it."""

from __future__ import annotations

import csv
import io
import json
import threading
import time
from collections.abc import Callable
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.pictures import HEIGHT, STILL, WIDTH
from tests.support.publishing import (
    CENTROID,
    JPEG,
    header,
    put_centroid,
    put_picture,
)
from tests.support.waiting import wait_until
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zv.tools.topic.options import (
    EchoOptions,
)


class Echo:
    """Runs echo and sends as soon as it listens."""

    def __init__(self, zv: Callable[..., list[str]], client: zenoh.Session) -> None:
        self._zv = zv
        self._client = client

    def __call__(
        self, options: EchoOptions, send: Callable[[], object], *, as_json: bool = False
    ) -> list[str]:
        publisher = self._client.declare_publisher(options.key)
        # The subscription of the run before may not be gone yet, and is not who is waited for.
        wait_until(lambda: not publisher.matching_status.matching)
        done = threading.Event()

        def send_when_heard() -> None:
            while not done.is_set():
                if publisher.matching_status.matching:
                    send()
                    return
                time.sleep(0.005)

        sender = threading.Thread(target=send_when_heard)
        sender.start()
        try:
            return self._zv(options, as_json=as_json)
        finally:
            done.set()
            sender.join()
            publisher.undeclare()


@pytest.fixture
def echoed(zv: Callable[..., list[str]], client: zenoh.Session) -> Echo:
    return Echo(zv, client)


KEY = "vision/c/centroid"


def centroids(client: zenoh.Session, count: int, **changes: Any) -> Callable[[], None]:
    def send() -> None:
        for seq in range(count):
            put_centroid(client, KEY, seq, **changes)

    return send


def test_echo_prints_header_and_fields(echoed, client):
    lines = echoed(EchoOptions(key=KEY, once=True), centroids(client, 3))
    assert lines[0].startswith(f"--- {KEY}  vision.Centroid.v1  ")
    assert lines[0].endswith(" ms after capture")
    assert lines[1:5] == ["header:", "  camera: c", "  epoch: 1000", "  seq: 0"]
    assert lines[-4:] == ["x: 0", "y: 2", "box: [1, 2, 3, 4]", "area: 0.5"]


def test_echo_as_json_is_one_object_a_line_with_all_that_was_sent(echoed, client):
    lines = echoed(EchoOptions(key=KEY, count=3), centroids(client, 5), as_json=True)
    found = [json.loads(line) for line in lines]
    assert [each["message"]["x"] for each in found] == [0, 10, 20]
    assert [each["message"]["header"]["seq"] for each in found] == [0, 1, 2]
    assert {each["encoding"] for each in found} == {CENTROID}


def test_echo_as_csv_can_be_read_as_csv(echoed, client):
    lines = echoed(EchoOptions(key=KEY, count=3, csv=True, header=False), centroids(client, 3))
    rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
    assert [(row["key"], row["x"], row["area"]) for row in rows] == [
        (KEY, str(x), "0.5") for x in (0, 10, 20)
    ]
    assert [json.loads(row["box"]) for row in rows] == [[1, 2, 3, 4]] * 3
    assert not any(name.startswith("header") for name in rows[0])


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("x", ["0", "10"]),
        ("centroid.x", ["0", "10"]),
        ("header.seq", ["0", "1"]),
        ("box.3", ["4", "4"]),
    ],
)
def test_echo_prints_one_field(echoed, client, field, values):
    assert echoed(EchoOptions(key=KEY, count=2, field=field), centroids(client, 2)) == values


def test_echo_of_a_field_that_is_not_there_is_wrong_use_and_names_those_that_are(echoed, client):
    with pytest.raises(ConfigurationError, match="header, x, y, box, area"):
        echoed(EchoOptions(key=KEY, field="z"), centroids(client, 1))


def test_echo_of_a_picture_is_its_header_format_and_size(echoed, client):
    key = "vision/c/image/compressed"
    lines = echoed(
        EchoOptions(key=key, once=True, header=False), lambda: put_picture(client, key, 3)
    )
    assert lines[1:] == ["format: jpeg", "width: 64", "height: 48", "encoding: bgr8", "bytes: 1000"]


def test_echo_of_a_bare_picture_reads_its_size_from_itself(echoed, client):
    lines = echoed(
        EchoOptions(key="a/b", once=True), lambda: client.put("a/b", STILL, encoding=JPEG)
    )
    assert lines[1:4] == ["format: jpeg", f"width: {WIDTH}", f"height: {HEIGHT}"]


def test_nothing_that_comes_over_the_network_steers_the_terminal(echoed, client):
    lines = echoed(
        EchoOptions(key="a/b", once=True),
        lambda: client.put("a/b", "\x1b[31mred\x07\u202e", encoding="text/plain"),
    )
    assert lines[1:] == ["text: \\x1b[31mred\\x07\\u202e"]


def test_a_deleted_key_is_shown_as_such(echoed, client):
    lines = echoed(EchoOptions(key="a/b", once=True), lambda: client.delete("a/b"))
    assert lines[1:] == ["deleted: true"]


def test_what_has_stopped_to_flow_is_shown_by_query(client, zv):
    body = msgpack.packb({"header": header(4), "x": 1})

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(KEY, body, encoding=CENTROID)

    queryable = client.declare_queryable(KEY, answer)
    assert zv(EchoOptions(key=KEY, once=True, field="header.seq")) == ["4"]
    queryable.undeclare()


def test_echo_that_is_given_a_time_and_gets_less_than_asked_is_1(echoed, client):
    with pytest.raises(ExpectationNotMet, match=f"2 of 5 messages arrived on {KEY} in 2 s"):
        echoed(EchoOptions(key=KEY, count=5, for_=2.0), centroids(client, 2))
    with pytest.raises(ExpectationNotMet, match="nothing matches nowhere"):
        echoed._zv(EchoOptions(key="nowhere", for_=0.2))
