"""One stream whose frames come through shared memory and over the network: each is seen once."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.intakes import JPEG, PIXELS, RAW_KEY, Taker, sample, take
from zenoh_vision.stream.sample import Sample


def over_network(seq: int, **fields: object) -> Sample:
    return sample(seq, **{"payload": JPEG, **fields})


def from_memory(seq: int, **fields: object) -> Sample:
    return sample(seq, memoryview(PIXELS.tobytes()), RAW_KEY, shared=True, **fields)


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
    intake = taker.frames(raw_key=RAW_KEY)
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
    intake = Taker().frames(raw_key=RAW_KEY)
    ways = []
    for seq, come in enumerate([over_network, from_memory, over_network, from_memory]):
        intake.receive(come(seq))
        assert take(intake).header.seq == seq
        ways.append(intake.way)
    assert ways == ["jpeg", "shm", "jpeg", "shm"]
    assert [state.way for state in intake.states()] == ["shm"]


def test_a_frame_of_the_network_with_a_high_number_keeps_none_of_memory_away():
    intake = Taker().frames(raw_key=RAW_KEY)
    intake.receive(from_memory(0))
    assert take(intake).header.seq == 0
    intake.receive(over_network(900, payload=JPEG[:200]))  # anyone can send it; it is broken
    intake.receive(from_memory(1))
    assert take(intake).header.seq == 1


def test_pixels_in_shared_memory_are_a_view_that_cannot_be_written_to_and_count_as_owned():
    intake = Taker().frames(raw_key=RAW_KEY)
    memory = bytearray(PIXELS.tobytes())
    intake.receive(sample(0, memoryview(memory).toreadonly(), RAW_KEY, shared=True))
    frame = take(intake)
    assert np.shares_memory(frame.bgr, np.frombuffer(memory, np.uint8))
    assert not frame.bgr.flags.writeable
    assert not frame.borrowed
    assert frame.keep() is frame
