"""JPEGs are found in a stream of bytes, whatever is between them; how a stream ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest

from tests.support.pictures.http_camera import picture
from tests.support.waiting import DEADLINE_S
from zv.camera.sources import jpeg_splitter
from zv.camera.sources.jpeg_splitter import EndlessPicture, JpegSplitter
from zv.camera.sources.jpeg_stream import JpegStream

GIVEN = [picture(index) for index in range(4)]


def parts(head: Callable[[bytes], bytes], tail: bytes = b"\r\n") -> bytes:
    return b"".join(head(jpeg) + jpeg + tail for jpeg in GIVEN)


def typed(kind: bytes) -> Callable[[bytes], bytes]:
    return lambda jpeg: (
        b"--frame\r\nContent-Type: %b\r\n\r\n" % (kind.replace(b"N", b"%d" % len(jpeg)))
    )


def sized(error: int) -> Callable[[bytes], bytes]:
    return lambda jpeg: b"--frame\r\nContent-Length: %d\r\n\r\n" % (len(jpeg) + error)


TEXT = b"--frame\r\nContent-Type: text/plain\r\nContent-Length: 5\r\n\r\nhello\r\n"
EMPTY = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: 0\r\n\r\n\r\n"
STREAMS = {
    "bare": b"".join(GIVEN),
    "no first boundary": parts(typed(b"image/jpeg")).removeprefix(b"--frame\r\n"),
    "image/jpg": parts(typed(b"image/jpg")),
    "a parameter of the type": parts(typed(b"image/jpeg;size=N")),
    "no type": parts(lambda _: b"--frame\r\n\r\n"),
    "text between": parts(lambda jpeg: TEXT + typed(b"image/jpeg")(jpeg)),
    "empty parts between": parts(lambda jpeg: EMPTY + typed(b"image/jpeg")(jpeg)),
    "a length too short": parts(sized(-500)),
    "a length too long": parts(sized(500)),
    "a doubled boundary": parts(typed(b"image/jpeg"), b"\r\n--frame\r\n"),
    "a boundary after": parts(lambda _: b"Content-Type: image/jpeg\r\n\r\n", b"\r\n--frame\r\n"),
    "line feeds": parts(lambda _: b"--frame\nContent-Type: image/jpeg\n\n", b"\n"),
    "padding": parts(typed(b"image/jpeg"), bytes(700)),
}  # fmt: skip


@pytest.mark.parametrize("size", [1, 7, 1 << 20], ids=["each byte", "7 bytes", "at once"])
@pytest.mark.parametrize("stream", STREAMS.values(), ids=STREAMS)
def test_each_picture_comes_once_as_it_was_sent(stream: bytes, size: int):
    splitter = JpegSplitter()
    chunks = [stream[start : start + size] for start in range(0, len(stream), size)]
    assert [each.data for chunk in chunks for each in splitter.feed(chunk)] == GIVEN
    assert splitter.cut == 0


def test_a_picture_comes_with_its_last_byte():
    splitter = JpegSplitter()
    assert list(splitter.feed(GIVEN[0][:-1])) == []
    assert [each.data for each in splitter.feed(GIVEN[0][-1:])] == [GIVEN[0]]


def test_a_preview_in_the_exif_data_is_not_the_picture():
    preview = b"Exif\0\0" + GIVEN[1]
    whole = GIVEN[0][:2] + b"\xff\xe1" + (len(preview) + 2).to_bytes(2, "big") + preview
    whole += GIVEN[0][2:]
    assert [each.data for each in JpegSplitter().feed(whole + GIVEN[2])] == [whole, GIVEN[2]]


@pytest.mark.parametrize("kept", [-200, 200, 3], ids=["in its data", "in its header", "at once"])
def test_a_picture_that_is_cut_short_takes_no_other_with_it(kept: int):
    splitter = JpegSplitter()
    stream = GIVEN[0] + GIVEN[1][:kept] + b"\r\n--frame\r\n\r\n" + GIVEN[2] + GIVEN[3]
    assert [each.data for each in splitter.feed(stream)] == [GIVEN[0], GIVEN[2], GIVEN[3]]
    assert splitter.cut == 1


def test_the_time_of_the_camera_is_read():
    stream = b"".join(
        b"--frame\r\nx-timeStamp: %b\r\n\r\n" % time + jpeg
        for time, jpeg in zip((b"12.500000", b"1790000000.25"), GIVEN, strict=False)
    )
    found = [each.time_s for each in JpegSplitter().feed(stream + GIVEN[2])]
    assert found == [12.5, 1790000000.25, None]


def test_a_picture_without_an_end_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(jpeg_splitter, "MAX_COMPRESSED_BYTES", 5000)
    splitter = JpegSplitter()
    list(splitter.feed(GIVEN[0][:-20] + bytes(4000)))
    with pytest.raises(EndlessPicture):
        list(splitter.feed(bytes(1000)))


def test_bytes_without_a_picture_take_no_memory():
    splitter = JpegSplitter()
    for _ in range(100):
        assert list(splitter.feed(bytes(1 << 20))) == []
    assert [each.data for each in splitter.feed(GIVEN[0])] == [GIVEN[0]]


class Server:
    """Sends a picture 0.3 s late and, once told to go on, another one so late and one at once."""

    name = "the server"
    DELAYS_S = (0.3, 0.3, 0.0)

    def __init__(self) -> None:
        self.may_go_on = threading.Event()
        self.sent_all = threading.Event()
        self.closed = threading.Event()

    def chunks(self) -> Iterator[bytes]:
        for index, delay_s in enumerate(self.DELAYS_S):
            time_s = time.monotonic() - delay_s
            jpeg = picture(index)
            head = f"X-Timestamp: {time_s:.6f}\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            yield f"--b\r\nContent-Type: image/jpeg\r\n{head}".encode() + jpeg + b"\r\n"
            self.may_go_on.wait(DEADLINE_S)
        self.sent_all.set()
        self.closed.wait(DEADLINE_S)

    def interrupt(self) -> None:
        self.may_go_on.set()
        self.closed.set()

    def close(self) -> None:
        self.interrupt()

    def why_ended(self) -> str:
        return "it ended"


def test_stamps_do_not_run_backwards_when_a_picture_comes_faster_than_those_before():
    server = Server()
    with closing(JpegStream(server, "it", DEADLINE_S, lambda: 0.0)) as stream:  # reads the first
        server.may_go_on.set()
        assert server.sent_all.wait(DEADLINE_S)
        stamps = [stream.read().stamp_ns for _ in Server.DELAYS_S]
    assert stamps == sorted(set(stamps))
