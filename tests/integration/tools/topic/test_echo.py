"""``zv topic echo``: every form of a message, and what ends it."""

from __future__ import annotations

import csv
import io
import json
import re
import threading
import time
from collections.abc import Callable
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.listening import known_queryable
from tests.support.pictures.encoded import HEIGHT, STILL, WIDTH
from tests.support.publishing import (
    CENTROID,
    JPEG,
    header,
    put_centroid,
)
from tests.support.waiting import wait_until
from zenoh_vision import Connection
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zv.tools.shared.output import Output
from zv.tools.topic import echo
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
    assert echoed(EchoOptions(key=KEY, count=2, field=(field,)), centroids(client, 2)) == values


def test_echo_prints_several_fields(echoed, client):
    options = EchoOptions(key=KEY, count=2, field=("header.seq", "x", "box"))
    box = "box=[1, 2, 3, 4]"
    assert echoed(options, centroids(client, 2)) == [
        f"header.seq=0 x=0 {box}",
        f"header.seq=1 x=10 {box}",
    ]
    lines = echoed(options, centroids(client, 2), as_json=True)
    assert [json.loads(line)["fields"] for line in lines] == [
        {"header.seq": seq, "x": 10 * seq, "box": [1, 2, 3, 4]} for seq in (0, 1)
    ]


def test_a_message_without_a_field_is_skipped_and_counted(echoed, client, capsys):
    def send() -> None:
        for body in ({"other": 1}, {"x": 7}, {"other": 2}, {"x": 8}):
            client.put("a/b", json.dumps(body), encoding="application/json")

    lines = echoed(EchoOptions(key="a/b", count=2, field=("x",)), send)
    assert lines == ["7", "8"]
    first, last = capsys.readouterr().err.splitlines()
    assert first == "zv: skipping messages without x: a/b (application/json) has other"
    assert last == "zv: skipped 2 messages without x"


@pytest.mark.parametrize("field", ["z", "centroid.z"])
def test_echo_of_a_field_that_a_type_never_has_is_wrong_use_and_names_those_it_has(
    echoed, client, field
):
    with pytest.raises(ConfigurationError, match="available there: header, x, y, box, area"):
        echoed(EchoOptions(key=KEY, field=(field,)), centroids(client, 1))


def test_echo_of_a_mistyped_field_names_the_near_one(echoed, client):
    with pytest.raises(ConfigurationError, match=r"has no such field; did you mean 'area'\?"):
        echoed(EchoOptions(key=KEY, field=("aera",)), centroids(client, 1))


def test_of_several_fields_only_that_is_named_which_a_message_lacks(echoed, client, capsys):
    for once in (True, False):
        options = EchoOptions(key=KEY, once=once, field=("header.seq", "nope", "x"))
        with pytest.raises(ConfigurationError, match=r"^--field nope: .*; available there: header"):
            echoed(options, centroids(client, 1))
    with pytest.raises(ExpectationNotMet, match="none of 1 messages was printed"):
        echoed(
            EchoOptions(key="a/b", field=("x", "nope"), for_=1.0),
            lambda: client.put("a/b", '{"x": 1}', encoding="application/json"),
        )
    assert capsys.readouterr().err.splitlines() == [
        "zv: skipping messages without nope: a/b (application/json) has x",
        "zv: skipped 1 message without nope",
    ]


def test_on_a_key_that_nobody_publishes_it_says_how_the_wait_ends(endpoint, client):
    notes: list[str] = []

    class Answering(Output):
        """Sends a message as soon as a note is printed."""

        def note(self, text: str) -> None:
            notes.append(text)
            client.put("nobody/here", "late", encoding="text/plain")

    options = EchoOptions(key="nobody/here", once=True)
    echo.run(options, Connection(endpoint, timeout_s=20), Answering())
    assert len(notes) == 1
    assert notes[0].endswith(" waiting for it (Ctrl-C ends it, --for 5s limits it)")


def test_a_deleted_key_is_shown_as_such(echoed, client):
    lines = echoed(EchoOptions(key="a/b", once=True), lambda: client.delete("a/b"))
    assert lines[1:] == ["deleted: true"]


def test_what_has_stopped_to_flow_is_shown_by_query(client, zv):
    body = msgpack.packb({"header": header(4), "x": 1})

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(KEY, body, encoding=CENTROID)

    queryable = known_queryable(client, KEY, answer)
    assert zv(EchoOptions(key=KEY, once=True, field=("header.seq",))) == ["4"]
    queryable.undeclare()


def test_echo_that_is_given_a_time_and_gets_less_than_asked_is_1(echoed, client):
    with pytest.raises(ExpectationNotMet, match=f"2 of 5 messages arrived on {KEY} in 1 s"):
        echoed(EchoOptions(key=KEY, count=5, for_=1.0), centroids(client, 2))
    with pytest.raises(ExpectationNotMet, match="nothing matches nowhere"):
        echoed._zv(EchoOptions(key="nowhere", for_=0.2))


def test_echo_draws_pictures_in_the_terminal(echoed, client):
    picture = "vision/c/image/compressed"
    options = EchoOptions(key=picture, once=True, image=True, image_form="blocks")
    about = header(0, encoding="bgr8", width=WIDTH, height=HEIGHT)

    def send() -> None:
        client.put(picture, STILL, encoding=JPEG, attachment=msgpack.packb(about))

    lines = echoed(options, send)
    assert lines[-1].startswith(f"c {WIDTH}x{HEIGHT} seq ")
    assert "\u2580" in lines[0]


def test_the_age_of_a_picture_that_is_drawn_counts_from_its_replay(echoed, client):
    picture = "vision/c/image/compressed"
    options = EchoOptions(key=picture, once=True, image=True, image_form="blocks")
    hour_ns = 3600 * 10**9

    def send() -> None:
        now_ns = time.time_ns()
        about = header(0, encoding="bgr8", width=WIDTH, height=HEIGHT)
        about |= {"stamp_ns": now_ns - hour_ns, "replay": now_ns, "replayed_ns": now_ns}
        client.put(picture, STILL, encoding=JPEG, attachment=msgpack.packb(about))

    (age_ms,) = re.findall(r", (\d+) ms old", echoed(options, send)[-1])
    assert int(age_ms) * 10**6 < hour_ns


@pytest.mark.parametrize(
    "fields",
    [{"key": "vision/*/image/compressed"}, {"key": KEY}, {"key": KEY, "csv": True}],
    ids=["several", "messages", "fields"],
)
def test_what_is_no_single_stream_of_pictures_is_not_drawn(zv, fields):
    with pytest.raises(ConfigurationError, match="--image"):
        zv(EchoOptions(**fields, image=True))


def test_a_stream_without_pictures_is_told(zv):
    options = EchoOptions(key="vision/c/image/compressed", image=True, for_=0.3)
    with pytest.raises(ExpectationNotMet, match="nothing"):
        zv(options)
