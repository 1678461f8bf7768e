"""``zv snapshot``: what lands in the file, what is said of it, and what is refused."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import msgpack
import numpy as np
import pytest
import zenoh

from tests.support.listening import known_queryable, open_client, wait_until_listed
from tests.support.pictures.encoded import HEIGHT, STILL, WIDTH, jpeg
from tests.support.publishing import RAW_PIXELS, Paced, raw_frames
from tests.support.publishing import header as publishing_header
from tests.support.waiting import DEADLINE_S
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zenoh_vision.transport.connection import Connection
from zv.tools.shared.output import Output
from zv.tools.snapshot import command
from zv.tools.snapshot.options import SnapshotOptions

KEY = "vision/c/image/compressed"
JPEG = "image/jpeg"
NO_JPEG = "vision/c/centroid"


@pytest.fixture
def zv(endpoint: str, capsysbinary) -> Callable[..., tuple[bytes, str]]:
    """Run a snapshot in this process; return what it wrote on both streams."""

    def run(
        key: str,
        output: object,
        *,
        as_json: bool = False,
        timeout_s: float = DEADLINE_S,
        **options: Any,
    ) -> tuple[bytes, str]:
        capsysbinary.readouterr()
        command.run(
            SnapshotOptions(key=key, output=str(output), **options),
            Connection(connect=endpoint, timeout_s=timeout_s),
            Output(as_json=as_json),
        )
        out, err = capsysbinary.readouterr()
        return out, err.decode()

    return run


def header(seq: int = 5, **changes: Any) -> dict[str, Any]:
    known = {"width": WIDTH, "height": HEIGHT, "encoding": "bgr8"}
    return publishing_header(seq, **known | changes)


@contextmanager
def answering(
    session: zenoh.Session,
    payload: bytes,
    *,
    key: str = KEY,
    encoding: str = JPEG,
    head: dict[str, Any] | None = None,
) -> Iterator[None]:
    """Answer queries on a key with a sample."""
    attachment = None if head is None else msgpack.packb(head)

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, payload, encoding=encoding, attachment=attachment)

    # complete, as a node's are: of such, Zenoh asks only one unless told otherwise
    queryable = known_queryable(session, key, answer, complete=True)
    try:
        yield
    finally:
        queryable.undeclare()


def test_the_newest_picture_lands_in_the_file_and_its_identity_on_standard_error(
    client, zv, tmp_path: Path
):
    head = header(stamp_ns=time.time_ns() - 2_000_000_000)
    with answering(client, STILL, head=head):
        out, said = zv(KEY, tmp_path / "a.jpg")
    assert (tmp_path / "a.jpg").read_bytes() == STILL
    assert out == b""
    assert said.startswith(f"zv: {KEY}: c epoch 1000 seq 5, {WIDTH}x{HEIGHT} bgr8, by camera_c, ")
    age_ms = float(said.split("by camera_c, ")[1].split(" ms old")[0])
    assert 2_000 <= age_ms <= (time.time_ns() - head["stamp_ns"]) / 1e6 + 1


def test_as_json_the_identity_is_on_standard_output(client, zv, tmp_path: Path):
    head = header()
    with answering(client, STILL, head=head):
        out, said = zv(KEY, tmp_path / "a.png", as_json=True)
    found = json.loads(out)
    assert found["header"] == head | {"revision": 0}
    assert found["bytes"] == (tmp_path / "a.png").stat().st_size
    assert said == ""


def test_a_dash_is_standard_output_and_nothing_else_is_there(client, zv):
    with answering(client, STILL, head=header()):
        out, said = zv(KEY, "-")
    assert out == STILL
    assert "seq 5" in said


@pytest.mark.parametrize("swapped", [False, True])
def test_the_newer_of_two_replies_is_taken(client, endpoint, zv, tmp_path: Path, swapped):
    old, new = header(1, stamp_ns=time.time_ns() - 10**9), header(2)
    with (
        open_client(endpoint) as other,
        answering(other if swapped else client, STILL, head=new),
        answering(
            client if swapped else other, jpeg(np.zeros((HEIGHT, WIDTH, 3), np.uint8)), head=old
        ),
    ):
        _, said = zv(KEY, tmp_path / "a.jpg")
    assert "seq 2," in said
    assert (tmp_path / "a.jpg").read_bytes() == STILL


def test_a_picture_without_a_header_is_saved_with_a_note(client, zv, tmp_path: Path):
    with answering(client, STILL):
        _, said = zv(KEY, tmp_path / "a.jpg")
        with pytest.raises(ExpectationNotMet, match="no header"):
            zv(KEY, tmp_path / "b.jpg", max_age=1.0)
    assert "no header" in said
    assert (tmp_path / "a.jpg").read_bytes() == STILL


def test_one_that_is_too_old_is_1_and_not_saved(client, zv, tmp_path: Path):
    head = header(stamp_ns=time.time_ns() - 60 * 10**9)
    with (
        answering(client, STILL, head=head),
        pytest.raises(ExpectationNotMet, match="allowed 1000 ms"),
    ):
        zv(KEY, tmp_path / "a.jpg", max_age=1.0)
    assert not (tmp_path / "a.jpg").exists()


def test_what_cannot_be_saved_says_why(client, zv, tmp_path: Path):
    file = tmp_path / "a.jpg"
    refused = pytest.raises(ExpectationNotMet, match="corrupt: Premature end of JPEG file")
    with answering(client, STILL[:-400], head=header()), refused:
        zv(KEY, file)
    refused = pytest.raises(ExpectationNotMet, match=r"bad_header: Header\.seq")
    with answering(client, STILL, head=header() | {"seq": "five"}), refused:
        zv(KEY, file)
    message = {"key": NO_JPEG, "encoding": "application/msgpack;vision.Centroid.v1"}
    refused = pytest.raises(ConfigurationError, match="carries Centroid, no picture; zv topic echo")
    with answering(client, msgpack.packb({"x": 1}), **message), refused:
        zv(NO_JPEG, file)
    assert not file.exists()


def test_what_is_asked_for_wrongly_says_why(client, zv, tmp_path: Path):
    other = answering(client, STILL, key="vision/d/image/compressed", head=header())
    with answering(client, STILL, head=header()), other:
        with pytest.raises(ConfigurationError, match=f"matches 2 keys, name one: {KEY}, "):
            zv("vision/*/image/compressed", tmp_path / "a.jpg")
        with pytest.raises(SourceError, match=r"/no/such/folder/a\.jpg"):
            zv(KEY, "/no/such/folder/a.jpg")
        with pytest.raises(ConfigurationError, match="give one"):
            zv(KEY, "-", as_json=True)


def test_where_nobody_answers_the_near_keys_of_pictures_are_named(client, zv, tmp_path: Path):
    own = "vision/c/thermal"
    publishers = [client.declare_publisher(key) for key in (KEY, own, NO_JPEG)]
    with pytest.raises(
        ExpectationNotMet, match=rf"did you mean {KEY}\? these exist: {KEY}, {own}$"
    ):
        zv("vision/c/image/compressedd", tmp_path / "a.jpg")
    for publisher in publishers:
        publisher.undeclare()


# --draw: each picture is of one grey level, its number; each result says the same number.


def shade(seq: int) -> int:
    return 5 + 2 * (seq % 100)


def flat_picture(seq: int) -> bytes:
    return jpeg(np.full((HEIGHT, WIDTH, 3), shade(seq), np.uint8), 95)


def with_results_late_by(
    client: zenoh.Session, frames: int, *, tracks: bool = False
) -> Callable[[], None]:
    """Return what sends a picture, and the centroid of one some frames ago."""
    numbers = iter(range(10**9))

    def send() -> None:
        seq = next(numbers)
        client.put(KEY, flat_picture(seq), encoding=JPEG, attachment=msgpack.packb(header(seq)))
        then = seq - frames
        if then < 0:
            return
        box = [shade(then), 100, 20, 20]
        body: dict[str, Any] = {"header": header(then, node="tracker_c")}
        if tracks:
            track = {"id": 0, "state": "confirmed", "x": 1.0, "y": 1.0, "box": box, "area": 1.0}
            client.put("vision/c/tracks", msgpack.packb(body | {"tracks": [track]}))
        else:
            body |= {"x": box[0] + 10, "y": 110, "box": box, "area": 400.0}
            client.put("vision/c/centroid", msgpack.packb(body))

    return send


@pytest.mark.parametrize("tracks", [False, True], ids=["centroid", "tracks"])
def test_what_is_drawn_belongs_to_the_picture_however_late_it_comes(
    client, zv, tmp_path: Path, tracks
):
    publisher = client.declare_publisher("vision/c/tracks" if tracks else "vision/c/centroid")
    with Paced(30, with_results_late_by(client, 4, tracks=tracks)):
        _, said = zv(KEY, tmp_path / "a.png", draw=True)
    publisher.undeclare()
    picture = cv2.imread(str(tmp_path / "a.png")).astype(int)
    left = int(picture[-1, -1, 0])  # the grey level of the picture says where the box must be
    green = (picture[:, :, 1] > 200) & (picture[:, :, 0] < 60)
    columns = np.nonzero(green[105:115].any(axis=0))[0]
    assert (columns.min(), columns.max()) == (
        pytest.approx(left, abs=2),
        pytest.approx(left + 20, abs=2),
    )
    assert f"with its {'tracks' if tracks else 'centroid'}" in said


@contextmanager
def publishing(client: zenoh.Session, key: str = KEY) -> Iterator[None]:
    """Publish bare pictures as a plain Zenoh program, which answers no query."""
    publisher = client.declare_publisher(key, encoding=JPEG)
    with Paced(20, lambda: publisher.put(STILL)):
        yield
    publisher.undeclare()


@pytest.mark.parametrize("pattern", [KEY, "vision/*/image/compressed"])
def test_where_no_query_is_answered_the_next_picture_is_taken(
    client, zv, tmp_path: Path, pattern: str
):
    with publishing(client):
        wait_until_listed(client, KEY)
        _, said = zv(pattern, tmp_path / "a.jpg")
    assert (tmp_path / "a.jpg").read_bytes() == STILL
    assert said.startswith(f"zv: {KEY}: no header, ")


def test_raw_pixels_without_an_encoding_are_known_by_their_key(client, zv, tmp_path: Path):
    with client.declare_publisher("vision/r1/image") as publisher:
        wait_until_listed(client, "vision/r1/image")
        with Paced(20, raw_frames(publisher)):
            zv("vision/r1/image", tmp_path / "a.png")
    assert (cv2.imread(str(tmp_path / "a.png")) == RAW_PIXELS).all()


def test_a_picture_that_is_put_without_a_publisher_is_taken_too(client, zv, tmp_path: Path):
    with Paced(20, lambda: client.put(KEY, STILL, encoding=JPEG)):
        zv(KEY, tmp_path / "a.jpg")
    assert (tmp_path / "a.jpg").read_bytes() == STILL


def test_of_several_keys_on_which_no_query_is_answered_one_must_be_named(
    client, zv, tmp_path: Path
):
    other = "vision/d/image/compressed"
    with publishing(client), publishing(client, other):
        wait_until_listed(client, KEY, other)
        with pytest.raises(ConfigurationError, match=f"2 keys, name one: {KEY}, {other}"):
            zv("vision/*/image/compressed", tmp_path / "a.jpg")


def test_a_publisher_that_sends_nothing_is_named_when_the_time_is_over(client, zv, tmp_path: Path):
    with client.declare_publisher(KEY):
        wait_until_listed(client, KEY)
        with pytest.raises(ExpectationNotMet, match=f"nothing arrived on {KEY}, although"):
            zv(KEY, tmp_path / "a.jpg", timeout_s=0.3)


def test_draw_without_a_tracker_says_so_at_once(client, zv, tmp_path: Path):
    refused = pytest.raises(ExpectationNotMet, match=r"nobody publishes .*; is a tracker running")
    with answering(client, STILL, head=header()), refused:
        zv(KEY, tmp_path / "a.jpg", draw=True)


def test_draw_refuses_a_key_of_several_cameras(client, zv, tmp_path: Path):
    refused = pytest.raises(ConfigurationError, match=r"--draw: vision/\*/image/compressed is not")
    with refused:
        zv("vision/*/image/compressed", tmp_path / "a.jpg", draw=True)


def test_draw_gives_up_when_nothing_belongs_together(client, zv, tmp_path: Path):
    publisher = client.declare_publisher("vision/c/centroid")
    wrong = threading.Event()

    def send() -> None:
        client.put(KEY, STILL, encoding=JPEG, attachment=msgpack.packb(header(1)))
        wrong.set()

    with Paced(30, send), pytest.raises(ExpectationNotMet, match=r"same frame within 2 s"):
        zv(KEY, tmp_path / "a.jpg", draw=True, timeout_s=2)
    assert wrong.is_set()
    publisher.undeclare()
