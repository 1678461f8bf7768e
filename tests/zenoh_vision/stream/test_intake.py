"""Bytes become frames, messages or counted drops, with no network and no waiting."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest

from tests.support.library import NOW_NS, header
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.messages import Centroid, Diagnostics
from zenoh_vision.stream.buffer import Buffering, latest, queue
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.epoch_gate import SILENCE_NS
from zenoh_vision.stream.frame_intake import FORGET_NS, MAX_KEYS, FrameIntake, snapshot_of
from zenoh_vision.stream.intake import Consumer, MessageIntake, SampleIntake
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES, Sample

KEY = "vision/front/image/compressed"
RAW_KEY = "vision/front/image"
PIXELS = np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3).astype(np.uint8)
JPEG = encode_jpeg(PIXELS, "bgr8", 90)
FAR_NS = 10**9


class Taker:
    """A consumer whose drops can be read."""

    def __init__(self) -> None:
        self.drops: list[str] = []
        self.counters = FrameCounters()
        self.consumer = Consumer(self.counters, lambda error: self.drops.append(error.reason))

    def frames(
        self, key: str = KEY, buffering: Buffering = latest, *, raw: bool = False, **options: Any
    ) -> FrameIntake:
        return FrameIntake(key, self.consumer, buffering, raw=raw, **options)

    def counted(self) -> dict[str, int]:
        found = self.counters.snapshot()
        dropped = sum(count for name, count in found.items() if name.startswith("dropped."))
        assert found["received"] == found["processed"] + dropped + found["pending"]
        return found


def sample(seq: int, payload: bytes | memoryview = JPEG, key: str = KEY, **fields: object):
    camera = key.split("/")[1]
    attachment = header(seq, camera=camera).to_bytes()
    given = {"attachment": attachment, "arrived_ns": FAR_NS + seq, "received_ns": NOW_NS + seq}
    return Sample(key, payload, **(given | fields))


def take(intake: FrameIntake):
    return intake.take(0, "bgr", 0.4)


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
    ],
)
def test_what_is_malformed_is_dropped_on_arrival_and_counted(wrong: Sample, reason: str):
    taker = Taker()
    intake = taker.frames("vision/*/image/compressed")
    intake.receive(wrong)
    assert take(intake) is None
    assert taker.drops == [reason]
    assert taker.counted()[f"dropped.{reason}"] == 1


@pytest.mark.parametrize("raw", [False, True])
def test_frames_over_the_consumers_pixels_are_dropped_on_arrival(raw: bool):
    payload, key = (bytes(64 * 48 * 3), RAW_KEY) if raw else (JPEG, KEY)
    for most, reasons in ((64 * 48, []), (64 * 48 - 1, ["too_large"])):
        taker = Taker()
        intake = taker.frames(key, raw=raw, max_pixels=most)
        assert intake.limit.max_bytes == (4 * most if raw else codecs.MAX_COMPRESSED_BYTES)
        intake.receive(sample(0, payload, key))
        assert taker.drops == reasons
        assert intake.buffer.filled is not bool(reasons)


def test_a_picture_that_cannot_be_decoded_is_dropped_when_it_is_taken():
    taker = Taker()
    intake = taker.frames()
    intake.receive(sample(0, JPEG[:-200]))
    assert take(intake) is None
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


WILDCARD = "vision/*/image/compressed"


def key_of(number: int) -> str:
    return f"vision/c{number}/image/compressed"


def test_with_a_wildcard_each_camera_has_a_state_of_its_own():
    taker = Taker()
    intake = taker.frames(WILDCARD)
    front, rear = KEY, "vision/rear/image/compressed"
    now_ns = time.monotonic_ns()
    for key, seq in ((front, 100), (rear, 5), (front, 100), (rear, 6)):
        intake.receive(sample(seq, key=key, arrived_ns=now_ns))
    found = {(frame.key, frame.header.seq) for frame in iter(lambda: take(intake), None)}
    assert found == {(front, 100), (rear, 6)}
    assert {state.key for state in intake.states()} == {front, rear}


def test_keys_without_end_cost_bounded_memory():
    taker = Taker()
    intake = taker.frames(WILDCARD)
    now_ns = time.monotonic_ns()
    for number in range(MAX_KEYS + 5):
        intake.receive(sample(0, key=key_of(number), arrived_ns=now_ns))
    assert taker.drops == ["too_many_keys"] * 5
    assert len(intake.states()) == MAX_KEYS


def test_a_key_without_a_good_header_has_no_state_and_takes_no_place():
    taker = Taker()
    intake = taker.frames(WILDCARD)
    for number in range(MAX_KEYS):
        intake.receive(sample(0, key=key_of(number), attachment=b"x"))
    assert [state.key for state in intake.states()] == [WILDCARD]
    intake.receive(sample(0, arrived_ns=time.monotonic_ns()))
    assert [state.key for state in intake.states()] == [KEY]
    assert take(intake).key == KEY


def test_a_new_key_replaces_the_one_that_has_been_silent_longest():
    taker = Taker()
    intake = taker.frames(WILDCARD)
    begin_ns = time.monotonic_ns()
    for number in range(MAX_KEYS):
        intake.receive(sample(0, key=key_of(number), arrived_ns=begin_ns + number))
    intake.receive(sample(1, key=key_of(0), arrived_ns=begin_ns + MAX_KEYS))
    replaced, kept = key_of(1), key_of(0)  # the first sent again
    intake.receive(sample(0, arrived_ns=begin_ns + SILENCE_NS))
    assert taker.drops == ["too_many_keys"], "the key that is replaced was silent for 1 ns less"
    intake.receive(sample(0, arrived_ns=begin_ns + SILENCE_NS + 1))
    keys = {state.key for state in intake.states()}
    assert len(keys) == MAX_KEYS
    assert {KEY, kept} < keys
    assert replaced not in keys


def test_a_frame_whose_key_was_replaced_while_it_waited_is_handed_out():
    taker = Taker()
    intake = taker.frames(WILDCARD, queue(MAX_KEYS + 1))
    for number in range(MAX_KEYS):
        intake.receive(sample(0, key=key_of(number)))
    intake.receive(sample(0, arrived_ns=FAR_NS + SILENCE_NS))
    assert key_of(0) not in intake._streams
    assert take(intake).key == key_of(0)


@pytest.mark.parametrize(
    ("key", "silent_ns", "known"),
    [
        pytest.param(WILDCARD, FORGET_NS // 2, {KEY}, id="for less than a minute"),
        pytest.param(WILDCARD, FORGET_NS, {WILDCARD}, id="for a minute"),
        pytest.param(KEY, 100 * FORGET_NS, {KEY}, id="one key, for ever"),
    ],
)
def test_a_camera_that_departed_is_forgotten_only_by_an_input_with_wildcards(
    key: str, silent_ns: int, known: set[str]
):
    intake = Taker().frames(key)
    last_ns = time.monotonic_ns() - silent_ns
    intake.receive(sample(0, arrived_ns=last_ns))
    states = intake.states()
    assert {state.key for state in states} == known
    assert states[0].since_ns == last_ns, "silent since its last frame"


def test_a_camera_that_stays_is_not_stale_for_one_that_departed():
    intake = Taker().frames(WILDCARD)
    now_ns = time.monotonic_ns()
    intake.receive(sample(0, key=key_of(1), arrived_ns=now_ns - FORGET_NS))
    intake.receive(sample(0, arrived_ns=now_ns))
    assert [state.key for state in intake.states()] == [KEY]


# Borrowed memory


class Lender:
    """Memory that a transport lends, and how often it came back."""

    def __init__(self) -> None:
        self.memory = bytearray(PIXELS.tobytes())
        self.returned = 0

    def sample(self, seq: int) -> Sample:
        return sample(seq, memoryview(self.memory), RAW_KEY, release=self._take_back)

    def _take_back(self) -> None:
        self.returned += 1
        self.memory[:] = bytes(len(self.memory))  # it is used for something else now


def test_a_frame_owns_its_memory_unless_borrowed_ones_are_asked_for():
    lender, taker = Lender(), Taker()
    intake = taker.frames(RAW_KEY, raw=True)
    intake.receive(lender.sample(0))
    frame = take(intake)
    assert not frame.borrowed
    assert frame.keep() is frame
    intake.close()
    assert np.array_equal(frame.pixels, PIXELS)


def test_a_borrowed_frame_is_valid_until_the_next_is_asked_for_and_a_kept_one_for_ever():
    lender, taker = Lender(), Taker()
    intake = taker.frames(RAW_KEY, raw=True, borrow=True)
    intake.receive(lender.sample(0))
    frame = take(intake)
    assert frame.borrowed
    assert np.shares_memory(frame.pixels, np.frombuffer(lender.memory, np.uint8))
    kept = frame.keep()
    assert lender.returned == 0
    assert take(intake) is None
    assert lender.returned == 1
    assert not frame.pixels.any()
    assert np.array_equal(kept.pixels, PIXELS)


def test_memory_is_given_back_exactly_once_whatever_becomes_of_the_frame():
    taken, displaced, refused, unread = lenders = [Lender() for _ in range(4)]
    taker = Taker()
    intake = taker.frames(RAW_KEY, raw=True, borrow=True)
    intake.receive(taken.sample(0))
    assert take(intake) is not None
    intake.receive(refused.sample(0))  # seen already
    intake.receive(displaced.sample(1))
    intake.receive(unread.sample(2))
    assert [lender.returned for lender in lenders] == [0, 1, 1, 0]
    intake.close(unread="unwatched")
    assert [lender.returned for lender in lenders] == [1, 1, 1, 1]
    assert taker.counted()["dropped.unwatched"] == 1


def test_what_arrives_while_its_input_closes_is_dropped_too():
    lender, taker = Lender(), Taker()
    intake = taker.frames(RAW_KEY, raw=True, borrow=True)
    intake.close(unread="unwatched")
    intake.receive(lender.sample(0))  # Zenoh's thread was in the callback
    assert lender.returned == 1
    assert taker.counted() == {"received": 1, "processed": 0, "dropped.unwatched": 1, "pending": 0}


def test_what_is_taken_while_its_input_closes_is_given_back_too(monkeypatch):
    lender, taker = Lender(), Taker()
    intake = taker.frames(RAW_KEY, raw=True, borrow=True)
    intake.receive(lender.sample(0))
    real = intake.buffer.take

    def take_as_it_closes(timeout_s: float):
        found = real(timeout_s)
        monkeypatch.undo()
        intake.close(unread="unwatched")  # on another thread
        return found

    monkeypatch.setattr(intake.buffer, "take", take_as_it_closes)
    assert take(intake) is None
    assert lender.returned == 1
    assert taker.counted()["dropped.unwatched"] == 1


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
        taker.frames(raw=True),
        MessageIntake(KEY, taker.consumer, message=Centroid),
        SampleIntake(KEY, taker.consumer, deletions=False),
    ):
        intake.receive(deletion)
    assert taker.drops == ["empty"] * 4
    with pytest.raises(PayloadError, match="empty"):
        snapshot_of(deletion, raw=True)


def test_inputs_that_share_a_condition_wake_one_consumer():
    taker = Taker()
    woken = itertools.count()
    consumer = Consumer(taker.counters, lambda _: None, lambda: next(woken))
    for key in ("a/b/c", "d/e/f"):
        SampleIntake(key, consumer).receive(Sample(key, b""))
    assert next(woken) == 2
