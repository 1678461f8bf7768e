"""A wake-up: nobody misses it, whoever waits and whenever it comes."""

from __future__ import annotations

import threading
import time

from zenoh_vision.host.wakeup import Wakeup

PATIENCE_S = 30.0


def test_each_of_several_threads_wakes_for_the_condition_it_waits_for():
    wakeup, done, order = Wakeup(), [False] * 4, []

    def wait(number: int) -> None:
        assert wakeup.wait_for(lambda: done[number], PATIENCE_S)
        order.append(number)

    threads = [threading.Thread(target=wait, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for number in (2, 0, 3, 1):
        done[number] = True
        wakeup.set()
        threads[number].join(PATIENCE_S / 2)
    assert order == [2, 0, 3, 1]


def test_no_change_is_missed_that_comes_while_a_thread_looks():
    here, there = Wakeup(), Wakeup()
    sent = seen = 0
    rounds = 2000

    def send() -> None:
        nonlocal sent
        for each in range(rounds):
            assert there.wait_for(lambda each=each: seen == each, PATIENCE_S)
            sent = each + 1
            here.set()

    thread = threading.Thread(target=send)
    began_s = time.monotonic()
    thread.start()
    for each in range(1, rounds + 1):
        assert here.wait_for(lambda each=each: sent == each, PATIENCE_S)
        seen = each
        there.set()
    assert time.monotonic() - began_s < PATIENCE_S  # none was found by a time-out alone
    thread.join()


def test_a_wait_ends_at_once_for_what_is_true_and_with_its_time_for_what_is_not():
    wakeup = Wakeup()
    assert wakeup.wait_for(lambda: True, 0)
    assert not wakeup.wait_for(lambda: False, 0)
    wakeup.set()
    wakeup.set()
    began_s = time.monotonic()
    assert not wakeup.wait_for(lambda: False, 0.05)
    assert time.monotonic() - began_s >= 0.05


def test_nothing_is_kept_of_threads_that_have_ended():
    wakeup, all_wait = Wakeup(), threading.Barrier(20)

    def wait() -> None:
        wakeup.wait(0)
        all_wait.wait(PATIENCE_S)  # so that no two have the same number

    threads = [threading.Thread(target=wait) for _ in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
    wakeup.wait(0)
    assert list(wakeup._asleep) == [threading.get_ident()]


def test_a_new_thread_that_has_the_number_of_an_ended_one_is_not_left_asleep(monkeypatch):
    wakeup, waits = Wakeup(), threading.Event()

    def wait() -> None:
        wakeup.wait(0)
        waits.set()
        wakeup.wait(PATIENCE_S)

    thread = threading.Thread(target=wait)
    thread.start()
    assert waits.wait(PATIENCE_S)
    monkeypatch.setattr("sys._current_frames", dict)  # as before the thread had started
    wakeup.wait(0)
    thread.join(PATIENCE_S / 2)
    assert not thread.is_alive()
