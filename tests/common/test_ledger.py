"""Counts balance at every moment."""

from __future__ import annotations

import threading

import pytest

from common.ledger import Ledger


def dropped(counters: dict[str, int]) -> int:
    return sum(count for name, count in counters.items() if name.startswith("dropped."))


def test_a_fresh_ledger_is_all_zero():
    assert Ledger().snapshot() == {"received": 0, "processed": 0, "pending": 0}


def test_each_arrival_is_pending_until_it_is_done_or_dropped():
    ledger = Ledger("captured", "published")
    for _ in range(5):
        ledger.arrive()
    ledger.finish()
    ledger.drop("overwritten")
    ledger.drop("corrupt")
    ledger.drop("overwritten")
    assert ledger.snapshot() == {
        "captured": 5,
        "published": 1,
        "dropped.corrupt": 1,
        "dropped.overwritten": 2,
        "pending": 1,
    }


def test_notes_are_no_part_of_the_balance():
    ledger = Ledger()
    ledger.note("missed", 7)
    ledger.note("missed")
    assert ledger.snapshot() == {"received": 0, "processed": 0, "pending": 0, "missed": 8}


@pytest.mark.parametrize("threads", [1, 4])
def test_every_snapshot_balances_under_load(threads: int):
    ledger = Ledger()
    started = threading.Barrier(threads + 1)
    frames = 3000

    def consume(number: int) -> None:
        started.wait()
        for n in range(frames):
            ledger.arrive()
            if n % 3 == 0:
                ledger.drop(f"reason_{number % 2}")
            else:
                ledger.finish()

    workers = [threading.Thread(target=consume, args=(number,)) for number in range(threads)]
    for worker in workers:
        worker.start()
    started.wait()
    snapshots = []
    while any(worker.is_alive() for worker in workers):
        snapshots.append(ledger.snapshot())
    for counters in snapshots:
        assert (
            counters["received"] == counters["processed"] + dropped(counters) + counters["pending"]
        )
        assert 0 <= counters["pending"] <= threads
    last = ledger.snapshot()
    assert last["received"] == threads * frames
    assert last["processed"] == threads * 2000
    assert dropped(last) == threads * 1000
    assert last["pending"] == 0
