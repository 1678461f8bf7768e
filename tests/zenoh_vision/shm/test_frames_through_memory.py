"""Frames through shared memory: intact, the newest, in memory as long as its views."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import noise
from tests.support.processes import ROOT, environment
from tests.support.shm_reading import Reading
from tests.support.waiting import wait_until
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import ENCODINGS
from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.messages import Header
from zenoh_vision.shm.machine import why_impossible
from zenoh_vision.stream.buffer import latest
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.stream.sample import Sample

pytest.importorskip("iceoryx2")

from zenoh_vision.shm.channel import VIEWS
from zenoh_vision.shm.machine import SharedMemoryError
from zenoh_vision.shm.reader import FrameReader
from zenoh_vision.shm.writer import FrameWriter

KEY = "vision/front/image"
WIDTH, HEIGHT = 64, 48


def a_header(seq: int, encoding: str = "bgr8", width: int = WIDTH, height: int = HEIGHT) -> Header:
    changes = {"width": width, "height": height, "encoding": encoding, "node": "camera_front"}
    return header(seq, stamp_ns=time.time_ns(), **changes)


def filled(seq: int, value: int, width: int = WIDTH, height: int = HEIGHT) -> Frame:
    pixels = np.full((height, width, 3), value, np.uint8)
    return Frame(a_header(seq, width=width, height=height), pixels)


class Way:
    """A writer, a reader and what has arrived."""

    def __init__(self) -> None:
        self.offer = f"test{uuid.uuid4().hex[:12]}"
        self.arrived: list[Sample] = []
        self.writer = FrameWriter(self.offer)
        self.reader = Reading(self.offer, self.arrived.append)

    def send(self, frame: Frame) -> Sample:
        """Write a frame and return the sample that arrives."""
        before = len(self.arrived)
        self.writer.write(frame)
        wait_until(lambda: len(self.arrived) > before)
        return self.arrived[-1]

    def close(self) -> None:
        self.reader.close()
        self.writer.close()


@pytest.fixture
def way() -> Iterator[Way]:
    found = Way()
    yield found
    found.close()


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_pixels_of_every_encoding_arrive_unchanged_with_their_header(way, encoding):
    pixels = noise(encoding, WIDTH, HEIGHT)
    sample = way.send(Frame(a_header(7, encoding), pixels))
    assert Header.from_bytes(sample.attachment).seq == 7
    assert np.array_equal(np.frombuffer(sample.payload, pixels.dtype).reshape(pixels.shape), pixels)
    assert (sample.route, sample.encoding) == ("shm", RAW_IMAGE)


def test_a_jpeg_arrives_as_it_is_and_is_not_decoded(way, monkeypatch):
    picture = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", picture)[1].tobytes()
    monkeypatch.setattr(codecs, "decode_jpeg", None)
    sample = way.send(Frame(a_header(0), jpeg))
    assert (sample.payload, sample.encoding) == (jpeg, "image/jpeg")
    assert Header.from_bytes(sample.attachment).seq == 0


def test_forms_and_sizes_may_change_from_frame_to_frame(way):
    for seq in range(6):
        sample = way.send(filled(2 * seq, seq, 64 << (seq % 3), 48 << (seq % 3)))
        assert set(bytes(sample.payload)) == {seq}
        jpeg = encode_jpeg(np.full((48 << seq % 4, 64 << seq % 4, 3), 9, np.uint8), "bgr8", 90)
        sample = way.send(
            Frame(a_header(2 * seq + 1, width=64 << seq % 4, height=48 << seq % 4), jpeg)
        )
        assert sample.payload == jpeg


def test_pixels_with_gaps_between_rows_arrive_without(way):
    whole = np.arange(HEIGHT * WIDTH * 6, dtype=np.uint8).reshape(HEIGHT, WIDTH * 2, 3)
    sample = way.send(Frame(a_header(0), whole[:, ::2]))
    assert bytes(sample.payload) == whole[:, ::2].tobytes()


def test_what_arrives_cannot_be_written_to(way):
    payload = way.send(filled(0, 1)).payload
    assert isinstance(payload, memoryview)
    assert payload.readonly
    assert not np.frombuffer(payload, np.uint8).flags.writeable


def test_kept_frames_stay_as_they_are_however_many_and_do_not_end_the_stream(way):
    kept = [way.send(filled(seq, seq)) for seq in range(4 * VIEWS)]
    for seq, sample in enumerate(kept):
        assert set(bytes(sample.payload)) == {seq}
    copies = [sample for sample in kept if isinstance(sample.payload, bytes)]
    assert len(copies) == len(kept) - (VIEWS - 1)


def test_views_that_nothing_refers_to_are_lent_again(way):
    for seq in range(4 * VIEWS):
        assert isinstance(way.send(filled(seq, seq)).payload, memoryview)
        way.arrived.clear()


def test_a_view_outlives_the_reader_and_the_writer(way):
    sample = way.send(filled(0, 9))
    pixels = np.frombuffer(sample.payload, np.uint8)
    way.arrived.clear()
    del sample
    way.close()
    assert set(pixels.tolist()) == {9}
    way.writer, way.reader = FrameWriter(way.offer), way.reader


def test_a_frame_that_nobody_reads_is_not_converted(way, monkeypatch):
    converted = []
    write = Frame.write
    monkeypatch.setattr(
        Frame, "write", lambda frame, target: converted.append(1) or write(frame, target)
    )
    way.send(filled(0, 0))
    way.reader.close()
    for seq in range(1, 5):
        assert not way.writer.write(filled(seq, 0))
    assert len(converted) <= 2  # the first after the reader left may still be written
    way.reader = Reading(way.offer, way.arrived.append)
    assert way.send(filled(5, 5))


def test_a_picture_that_cannot_be_decoded_costs_no_memory_while_its_error_is_kept(way):
    frame = filled(0, 1)

    def write(_target: object) -> None:
        raise PayloadError("corrupt", "by the test")

    frame.picture.write = write  # type: ignore[method-assign]
    with pytest.raises(PayloadError) as kept:
        way.writer.write(frame)
    assert set(bytes(way.send(filled(1, 7)).payload)) == {7}
    assert kept.value.reason == "corrupt"


def test_a_larger_frame_follows_a_smaller_one(way):
    way.send(filled(0, 1))
    sample = way.send(filled(1, 2, 640, 480))
    assert len(sample.payload) == 640 * 480 * 3


def test_a_slow_consumer_sees_the_newest_frame_and_its_losses_are_counted(way):
    way.reader.close()
    counters = FrameCounters()
    intake = FrameIntake(KEY, Consumer(counters, lambda _: None), latest)
    reader = Reading(way.offer, intake.receive)
    way.writer.write(filled(0, 0))
    assert intake.take(5, "pixels", None) is not None  # a frame before it verifies an epoch
    counters.finish()
    for seq in range(1, 20):
        way.writer.write(filled(seq, seq))
    seen = []
    while (frame := intake.take(0.3, "pixels", None)) is not None:
        seen.append(frame.header.seq)
        counters.finish()
        assert set(np.unique(frame.pixels)) == {frame.header.seq}
    assert seen[-1] == 19
    found = counters.snapshot()
    assert found["received"] == found["processed"] + found.get("dropped.overwritten", 0)
    assert found["received"] + found.get("missed", 0) == 20
    reader.close()
    intake.close()


def test_a_reader_of_an_offer_that_is_not_in_this_memory_says_so():
    with pytest.raises(SharedMemoryError, match="nobody"):
        FrameReader("nobody", KEY)


def test_a_waiting_reader_holds_up_no_other_thread(way):
    done = threading.Event()
    threading.Thread(target=done.set).start()  # cannot start while a thread keeps the interpreter
    began_s = time.process_time()
    assert done.wait(20)
    assert time.process_time() - began_s < 0.05


def test_two_writers_of_one_offer_are_refused(way):
    with pytest.raises(SharedMemoryError, match="exists"):
        FrameWriter(way.offer)


UNSHARE = ["unshare", "--map-root-user", "--mount"]
FULL = "/dev/shm is full"


def allowed() -> bool:
    try:
        return subprocess.run([*UNSHARE, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.skipif(bool(why_impossible()), reason=why_impossible() or "-")
@pytest.mark.skipif(not allowed(), reason="needs a mount of its own: unshare is not allowed here")
@pytest.mark.parametrize(
    ("width", "height"),
    [(320, 240), (285, 8)],
    ids=["large", "so small that several pieces of memory lie in a page"],
)
def test_a_full_memory_is_an_error_before_anything_is_written_to_it(width, height):
    program = [*UNSHARE, sys.executable, "-m", "tests.support.programs.full_memory"]
    program += [str(width), str(height)]
    done = subprocess.run(
        program, capture_output=True, text=True, timeout=60, cwd=ROOT, env=environment()
    )
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert json.loads(done.stdout) == {
        "a frame larger than the memory": FULL,
        "while there is room": "",
        "when it has become full": FULL,
        "views stay": "",
        "when there is room again": "",
    }
