"""Threads that wait are woken by what arrives, and never miss it."""

from __future__ import annotations

import threading
import time

from zenoh_vision.stream.notifier import Notifier

PATIENT_S = 30.0


def test_a_condition_that_holds_is_not_waited_for():
    assert Notifier().wait_for(lambda: True, 0.0)
    begun_s = time.monotonic()
    assert Notifier().wait_for(lambda: True, PATIENT_S)
    assert time.monotonic() - begun_s < PATIENT_S / 2


def test_a_condition_that_never_holds_ends_with_the_time():
    begun_s = time.monotonic()
    assert not Notifier().wait_for(lambda: False, 0.05)
    assert time.monotonic() - begun_s >= 0.05
    assert not Notifier().wait_for(lambda: False, 0.0)


def test_all_threads_that_wait_are_woken():
    notifier, arrived, seen = Notifier(), threading.Event(), []
    threads = [
        threading.Thread(
            target=lambda: seen.append(notifier.wait_for(arrived.is_set, PATIENT_S)), daemon=True
        )
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    deadline_s = time.monotonic() + PATIENT_S
    while len(notifier._waiting) < 3 and time.monotonic() < deadline_s:
        time.sleep(0.001)
    arrived.set()
    notifier.notify()
    for thread in threads:
        thread.join(PATIENT_S / 2)
    assert seen == [True, True, True]


def test_a_thread_that_is_woken_for_something_else_waits_on():
    notifier, arrived, seen = Notifier(), threading.Event(), []
    thread = threading.Thread(
        target=lambda: seen.append(notifier.wait_for(arrived.is_set, PATIENT_S)), daemon=True
    )
    thread.start()
    for _ in range(20):
        notifier.notify()
        time.sleep(0.001)
    assert not seen
    arrived.set()
    notifier.notify()
    thread.join(PATIENT_S / 2)
    assert seen == [True]


def test_nobody_stays_entered_after_a_time_out():
    notifier = Notifier()
    notifier.wait_for(lambda: False, 0.01)
    assert not notifier._waiting
    notifier.notify()


def test_what_arrives_while_a_thread_begins_to_wait_is_never_missed():
    """Two threads hand a number over and back; one that is missed would cost the time-out."""
    notifier = Notifier()
    rounds, turn = 3000, [0]
    missed = []

    def play(parity: int) -> None:
        for number in range(parity, rounds, 2):
            if not notifier.wait_for(lambda n=number: turn[0] == n, PATIENT_S):
                missed.append(number)
                return
            turn[0] = number + 1
            notifier.notify()

    threads = [threading.Thread(target=play, args=(parity,), daemon=True) for parity in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(2 * PATIENT_S)
    assert not missed
    assert turn[0] == rounds
