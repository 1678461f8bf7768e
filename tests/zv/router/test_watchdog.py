"""A router that does not answer is found, and nothing else is taken for one."""

from __future__ import annotations

import threading

import pytest

from tests.support.waiting import wait_until
from zv.router import watchdog
from zv.router.watchdog import HUNG_S, Watchdog

STEP_S = 0.5


class Clock:
    """Monotonic seconds that only a test lets pass."""

    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watchdog, "PERIOD_S", 0.001)


def seconds_to_hang(dog: Watchdog, clock: Clock) -> float:
    begun_s = clock.now_s
    while not dog.hangs():
        clock.now_s += STEP_S
        assert clock.now_s < begun_s + 60
    return clock.now_s - begun_s


def test_a_router_that_never_returns_from_a_question_hangs_after_5_s():
    clock, never = Clock(), threading.Event()
    dog = Watchdog(never.wait, clock)
    assert seconds_to_hang(dog, clock) == HUNG_S + STEP_S
    never.set()


def test_each_answer_begins_the_time_anew():
    clock, answer, asked = Clock(), threading.Event(), []

    def ask() -> None:
        asked.append(clock.now_s)
        (answer if len(asked) == 1 else never).wait()

    never = threading.Event()
    dog = Watchdog(ask, clock)
    for _ in range(8):
        clock.now_s += STEP_S
        assert not dog.hangs()
    answer.set()
    wait_until(lambda: len(asked) == 2)  # so the first answer has been taken
    assert seconds_to_hang(dog, clock) == HUNG_S + STEP_S
    never.set()


def test_time_in_which_the_process_was_frozen_does_not_count():
    clock, never = Clock(), threading.Event()
    dog = Watchdog(never.wait, clock)
    clock.now_s += 60
    assert not dog.hangs()
    assert seconds_to_hang(dog, clock) == HUNG_S + STEP_S
    never.set()


def test_it_ends_once_the_last_question_is_answered():
    asked = threading.Semaphore(0)
    dog = Watchdog(asked.release)
    assert asked.acquire(timeout=30)
    assert dog.end(30)


def test_it_says_that_the_last_question_was_never_answered():
    never = threading.Event()
    assert not Watchdog(never.wait).end(0.01)
    never.set()
