"""Frames of all cameras by one input: a state for each key, and a limit to their number."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tests.support.headers import header
from tests.support.intakes import FAR_NS, KEY, PIXELS, RAW_KEY, Taker, sample, take
from zenoh_vision.errors import PayloadError
from zenoh_vision.image.depth import ValueRange
from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.stream.buffer import queue
from zenoh_vision.stream.epoch_gate import SILENCE_NS
from zenoh_vision.stream.frame_intake import FORGET_NS, MAX_KEYS

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


def test_compressed_and_raw_frames_of_a_camera_are_one_stream_in_which_each_counts_once():
    taker = Taker()
    intake = taker.frames()
    raw = PIXELS.tobytes()
    intake.receive(sample(5))
    assert take(intake).picture.form == "image/jpeg"
    intake.receive(sample(5, raw, RAW_KEY))
    assert taker.counters.snapshot()["dropped.duplicate"] == 1
    intake.receive(sample(6, raw, RAW_KEY))
    assert (take(intake).pixels == PIXELS).all()
    assert [state.key for state in intake.states()] == [RAW_KEY]
    intake.receive(sample(7, raw, RAW_KEY))
    intake.receive(sample(8))
    assert take(intake).header.seq == 8, "the newest, whatever its key"
    assert take(intake) is None
    assert taker.counters.snapshot()["dropped.overwritten"] == 1


def test_each_camera_has_a_range_of_depth_of_its_own():
    intake = Taker().frames("vision/*/image", encoding=RAW_IMAGE)
    intake.depth_limits = (None, None)
    found = []
    for camera, value in (("near", 500), ("far", 9000), ("near", 600)):
        key, shape = f"vision/{camera}/image", {"width": 2, "height": 1, "encoding": "16UC1"}
        head = header(value, camera=camera, **shape).to_bytes()
        pixels = np.array([[value, value + 100]], "<u2").tobytes()
        intake.receive(sample(value, pixels, key, attachment=head))
        found.append(take(intake).value_range)
    assert found == [ValueRange(500, 600), ValueRange(9000, 9100), ValueRange(600, 700)]


def test_raw_pixels_beside_compressed_frames_have_a_limit_of_their_own():
    intake = Taker().frames(max_pixels=100)
    intake.limit.check(400, RAW_IMAGE)  # 4 bytes a pixel
    intake.limit.check(32 << 20, "image/jpeg")
    for most, encoding in ((400, RAW_IMAGE), (32 << 20, "image/jpeg")):
        with pytest.raises(PayloadError, match=f"at most {most} are"):
            intake.limit.check(most + 1, encoding)
