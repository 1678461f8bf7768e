"""A camera's offer of shared memory: withdrawn when the memory is full, and made again later."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.support.clocks import SteppedClock
from tests.support.headers import header
from zenoh_vision.image.frame import Frame
from zenoh_vision.node import memory_offer
from zenoh_vision.node.memory_offer import AGAIN_NS, MemoryOffer
from zenoh_vision.shm.machine import FULL, SharedMemoryError

FRAME = Frame(header(0), np.zeros((48, 64, 3), np.uint8))
AGAIN_S = AGAIN_NS / 1e9
LACKING = f"no frames of front through shared memory: {FULL}"


class Memory:
    """An offer with a clock, memory that may be full, and consumers that may ask for frames."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock = SteppedClock()
        self.full = False
        self.asked = True
        self.tokens = 0
        memory = self

        class Writer:
            def __init__(self, _offer: str) -> None: ...

            def write(self, _frame: Frame) -> bool:
                if memory.full:
                    raise SharedMemoryError(FULL)
                return True

            def close(self) -> None: ...

        class WhoAsks:
            @property
            def exists(self) -> bool:
                return memory.asked

            def follow_newest(self) -> None: ...

        monkeypatch.setattr(memory_offer, "FrameWriter", Writer)
        monkeypatch.setattr(memory_offer, "Demand", WhoAsks)
        monkeypatch.setattr(memory_offer, "machine_identity", lambda: "machine")
        link: Any = SimpleNamespace(declare=self._declare)
        self.offer = MemoryOffer(link, "vision", "front", self.clock)

    def _declare(self, *_make: object) -> Any:
        self.tokens += 1
        return SimpleNamespace(undeclare=self._undeclare)

    def _undeclare(self) -> None:
        self.tokens -= 1

    def write_after(self, seconds: float) -> bool:
        self.clock.step(seconds)
        return self.offer.write(FRAME)


@pytest.fixture
def memory(monkeypatch) -> Memory:
    return Memory(monkeypatch)


def test_a_full_memory_withdraws_the_offer_and_makes_it_again_later(memory):
    assert memory.write_after(0)
    memory.full = True
    assert not memory.write_after(1)
    assert (memory.tokens, memory.offer.failure) == (0, LACKING)
    memory.full = False
    assert not memory.write_after(AGAIN_S - 1)
    assert memory.write_after(2)
    assert (memory.tokens, memory.offer.failure) == (2, "")


def test_the_failure_lasts_while_someone_may_still_ask_and_ends_if_nobody_does(memory):
    memory.full = True
    assert not memory.write_after(0)
    memory.full = memory.asked = False
    assert not memory.write_after(AGAIN_S + 1)
    assert (memory.tokens, memory.offer.failure) == (2, LACKING)
    assert not memory.write_after(AGAIN_S + 1)
    assert memory.offer.failure == ""


def test_a_memory_that_stays_full_is_said_once(memory, caplog):
    memory.full = True
    for _ in range(3):
        assert not memory.write_after(AGAIN_S + 1)
    assert [record.getMessage().partition(";")[0] for record in caplog.records] == [LACKING]


def test_nothing_is_written_that_nobody_asks_for(memory):
    memory.asked = False
    assert not memory.write_after(0)
    assert memory.tokens == 2


def test_a_closed_offer_writes_nothing_and_is_not_made_again(memory):
    memory.offer.close()
    assert not memory.write_after(AGAIN_S + 1)
    assert memory.tokens == 0
