"""Bytes become frames, messages or counted drops, with no network and no waiting."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.headers import NOW_NS, header
from tests.support.intakes import JPEG, KEY, PIXELS, RAW_KEY, Taker, sample, take
from zenoh_vision.errors import PayloadError
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.image import codecs, forms
from zenoh_vision.keys import JPEG as JPEG_ENCODING
from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.messages import Centroid, Diagnostics
from zenoh_vision.stream.buffer import queue
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.intake import Consumer, MessageIntake, SampleIntake
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES, Sample


def test_bytes_of_a_sample_become_a_decoded_frame():
    taker = Taker()
    intake = taker.frames()
    intake.receive(sample(3))
    frame = take(intake)
    assert (frame.header.seq, frame.header.received_ns, frame.key) == (3, NOW_NS + 3, KEY)
    assert frame.compressed is JPEG
    assert frame.bgr.shape == (48, 64, 3)
    assert taker.counted() == {"received": 1, "processed": 0, "pending": 1}


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        pytest.param(sample(0, b"no picture"), "not_an_image", id="no picture"),
        pytest.param(sample(0, b""), "empty", id="no bytes"),
        pytest.param(sample(0, attachment=b"x"), "bad_header", id="no header"),
        pytest.param(
            sample(0, attachment=bytes(MAX_ATTACHMENT_BYTES + 1)), "bad_header", id="too long"
        ),
        pytest.param(
            sample(0, key="vision/rear/image/compressed", attachment=header(0).to_bytes()),
            "wrong_camera",
            id="another camera",
        ),
        pytest.param(sample(0, received_ns=0), "bad_stamp", id="from tomorrow"),
        pytest.param(
            sample(0, attachment=header(0, width=65).to_bytes()), "wrong_size", id="wider"
        ),
        pytest.param(
            sample(0, attachment=header(0, width=48, height=64).to_bytes()),
            "wrong_size",
            id="turned",
        ),
    ],
)
def test_what_is_malformed_is_dropped_on_arrival_and_counted(wrong: Sample, reason: str):
    taker = Taker()
    intake = taker.frames("vision/*/image/compressed")
    assert not intake.receive(wrong)
    assert not intake.buffer.filled
    assert taker.drops == [reason]
    assert taker.counted()[f"dropped.{reason}"] == 1


@pytest.mark.parametrize("raw", [False, True])
def test_frames_over_the_consumers_pixels_are_dropped_on_arrival(raw: bool):
    payload, key = (bytes(64 * 48 * 3), RAW_KEY) if raw else (JPEG, KEY)
    for most, reasons in ((64 * 48, []), (64 * 48 - 1, ["too_large"])):
        taker = Taker()
        encoding = RAW_IMAGE if raw else JPEG_ENCODING
        intake = taker.frames(key, encoding=encoding, max_pixels=most)
        limit = intake.limit.max_bytes
        assert limit == (4 * most if raw else codecs.MAX_COMPRESSED_BYTES)
        intake.receive(sample(0, payload, key))
        assert taker.drops == reasons
        assert intake.buffer.filled is not bool(reasons)


def test_a_picture_that_cannot_be_decoded_is_dropped_when_it_is_taken():
    taker = Taker()
    intake = taker.frames()
    intake.receive(sample(0, JPEG[:-200]))
    assert take(intake) is None
    assert taker.drops == ["corrupt"]


def test_a_consumer_that_decodes_later_gets_no_damaged_picture_of_a_new_epoch():
    """Its header alone would end the true stream."""
    taker = Taker()
    intake = taker.frames()
    intake.receive(sample(0, JPEG[:-200]))
    assert intake.take(0, lambda _: None, 0.4) is None
    assert taker.drops == ["corrupt"]


def test_what_the_transport_could_not_read_is_counted():
    taker = Taker()
    taker.frames().reject(PayloadError("too_large", "100 MB"))
    assert taker.drops == ["too_large"]
    assert taker.counted()["dropped.too_large"] == 1


def test_latest_hands_out_the_newest_and_counts_the_others_as_overwritten():
    taker = Taker()
    intake = taker.frames()
    intake.receive(sample(0))
    assert take(intake).header.seq == 0  # its epoch is verified now
    taker.counters.finish()
    for seq in (1, 2, 3):
        intake.receive(sample(seq))
    assert take(intake).header.seq == 3
    assert take(intake) is None
    assert taker.counted()["dropped.overwritten"] == 2


def test_a_queue_hands_out_all_in_order_and_counts_its_overflow():
    taker = Taker()
    intake = taker.frames(buffering=queue(3))
    intake.receive(sample(0))
    assert take(intake).header.seq == 0
    for seq in range(1, 6):
        intake.receive(sample(seq))
    assert [take(intake).header.seq for _ in range(3)] == [3, 4, 5]
    assert taker.counted()["dropped.overflow"] == 2


def test_a_queue_of_samples_is_limited_in_bytes():
    taker = Taker()
    intake = SampleIntake("vision/**", taker.consumer, queue(1000, max_bytes=10))
    for number in range(4):
        intake.receive(Sample(KEY, bytes([number] * 4)))
    assert [intake.take(0).payload[0] for _ in range(2)] == [2, 3]
    assert taker.counted()["dropped.overflow"] == 2


def test_a_queue_needs_a_place():
    with pytest.raises(ValueError, match="at least 1"):
        queue(0)


# Messages and samples

CENTROID = Centroid(header=header(4), x=1, y=2, box=(0, 0, 3, 4), area=12.0)
CENTROID_ENCODING = "application/msgpack;vision.Centroid.v1"


def message_sample(payload: bytes, encoding: str = CENTROID_ENCODING) -> Sample:
    return Sample("vision/front/centroid", payload, encoding)


@pytest.mark.parametrize("message", [Centroid, None], ids=["given", "by its encoding"])
def test_a_message_is_decoded_into_its_class(message):
    taker = Taker()
    intake = MessageIntake("vision/front/centroid", taker.consumer, message=message)
    intake.receive(message_sample(CENTROID.to_bytes()))
    assert intake.take(0) == CENTROID


def test_a_malformed_message_and_one_of_an_unknown_class_are_counted():
    taker = Taker()
    intake = MessageIntake("vision/**", taker.consumer, queue(9))
    intake.receive(message_sample(b"\xc1"))
    intake.receive(message_sample(CENTROID.to_bytes(), "application/msgpack;my.Own.v1"))
    intake.receive(message_sample(bytes(MAX_MESSAGE_BYTES + 1)))  # costs no place in the queue
    assert intake.take(0) is None
    assert taker.drops == ["unknown_message", "bad_message", "bad_message"]
    assert taker.counted()["pending"] == 0


def test_a_message_of_a_given_class_may_come_under_any_encoding():
    taker = Taker()
    intake = MessageIntake("vision/front/centroid", taker.consumer, message=Diagnostics)
    intake.receive(message_sample(CENTROID.to_bytes(), ""))
    assert intake.take(0) is None
    assert taker.drops == ["bad_message"]


def test_samples_come_as_they_are_in_order_and_pending_until_done():
    taker = Taker()
    intake = SampleIntake("vision/**", taker.consumer, queue(10))
    sent = [message_sample(bytes([n]), "text/plain") for n in range(3)]
    for each in sent:
        intake.receive(each)
    assert [intake.take(0) for _ in range(3)] == sent
    assert taker.counted()["pending"] == 3


def test_a_deletion_is_a_sample_but_neither_a_frame_nor_a_message():
    taker = Taker()
    deletion = Sample(KEY, b"", deleted=True)
    samples = SampleIntake("vision/**", taker.consumer)
    samples.receive(deletion)
    assert samples.take(0) is deletion
    for intake in (
        taker.frames(),
        taker.frames(encoding=RAW_IMAGE),
        MessageIntake(KEY, taker.consumer, message=Centroid),
        SampleIntake(KEY, taker.consumer, deletions=False),
    ):
        intake.receive(deletion)
    assert taker.drops == ["empty"] * 4
    with pytest.raises(PayloadError, match="empty"):
        snapshot_of(deletion, RAW_IMAGE)


def test_a_size_that_a_payload_states_is_checked_though_its_form_needs_a_header(
    monkeypatch: pytest.MonkeyPatch,
):
    class Stated(forms.PngForm):
        name, encoding, needs_header = "stated", "application/x-stated", True

    monkeypatch.setattr(forms, "FORMS", {JPEG_ENCODING: forms.JPEG_FORM})
    forms.register(Stated())
    taker = Taker()
    intake = taker.frames(encoding=Stated.encoding)
    png = codecs.encode_png(PIXELS)
    intake.receive(sample(0, png, attachment=header(0, width=640, height=100).to_bytes()))
    assert taker.drops == ["wrong_size"]
    intake.receive(sample(0, png))
    assert np.array_equal(take(intake).pixels, PIXELS)


def test_inputs_that_share_a_condition_wake_one_consumer():
    taker = Taker()
    woken = []

    class Counted(Wakeup):
        def set(self) -> None:
            woken.append(1)

    consumer = Consumer(taker.counters, lambda _: None, Counted())
    for key in ("a/b/c", "d/e/f"):
        SampleIntake(key, consumer).receive(Sample(key, b""))
    assert len(woken) == 2


def test_a_bare_png_of_16_bits_is_assumed_to_be_one():
    intake = Taker().frames()
    depth = np.arange(64 * 48, dtype=np.uint16).reshape(48, 64)
    intake.receive(sample(0, codecs.encode_png(depth), attachment=None))
    frame = take(intake)
    assert (frame.header.encoding, frame.header.assumed) == ("mono16", True)
    assert np.array_equal(frame.pixels, depth)


def over_network(seq: int, **fields: object) -> Sample:
    return sample(seq, **{"payload": JPEG, **fields})


def from_memory(seq: int, **fields: object) -> Sample:
    return sample(seq, memoryview(PIXELS.tobytes()), KEY, encoding=RAW_IMAGE, route="shm", **fields)


@pytest.mark.parametrize(
    ("first", "then"),
    [
        (from_memory(5), over_network(5)),
        (over_network(5), from_memory(5)),
        (from_memory(5), over_network(4)),
    ],
)
@pytest.mark.parametrize("taken", [False, True])
def test_a_frame_that_came_the_other_way_is_dropped_without_a_word(first, then, taken):
    taker = Taker()
    intake = taker.frames()
    intake.receive(over_network(3))
    assert take(intake).header.seq == 3
    intake.receive(first)
    seen = [take(intake)] if taken else []
    intake.receive(then)
    seen += [take(intake)]
    assert [frame.header.seq for frame in seen if frame] == [5]
    assert taker.counted()["dropped.duplicate"] == 1
    assert taker.drops == []


def test_later_frames_of_either_way_follow():
    intake = Taker().frames()
    ways = []
    for seq, come in enumerate([over_network, from_memory, over_network, from_memory]):
        intake.receive(come(seq))
        assert take(intake).header.seq == seq
        ways.append(intake.states()[0].route)
    assert ways == ["jpeg", "shm", "jpeg", "shm"]
    assert [state.route for state in intake.states()] == ["shm"]


def test_a_frame_of_the_network_with_a_high_number_keeps_none_of_memory_away():
    intake = Taker().frames()
    intake.receive(from_memory(0))
    assert take(intake).header.seq == 0
    intake.receive(over_network(900, payload=JPEG[:200]))  # anyone can send it; it is broken
    intake.receive(from_memory(1))
    assert take(intake).header.seq == 1


def test_pixels_in_shared_memory_are_a_view_that_cannot_be_written_to():
    intake = Taker().frames()
    memory = bytearray(PIXELS.tobytes())
    intake.receive(sample(0, memoryview(memory).toreadonly(), KEY, encoding=RAW_IMAGE, route="shm"))
    frame = take(intake)
    assert np.shares_memory(frame.bgr, np.frombuffer(memory, np.uint8))
    assert not frame.bgr.flags.writeable
