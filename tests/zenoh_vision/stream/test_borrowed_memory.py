"""Frames in memory that is lent: copied or borrowed, and given back exactly once."""

from __future__ import annotations

import numpy as np

from tests.support.intakes import PIXELS, RAW_KEY, Taker, sample, take
from zenoh_vision.stream.sample import Sample


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
