"""Counts balance at every moment."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zenoh_vision.health.health import Health
from zenoh_vision.messages import Diagnostics
from zenoh_vision.stream.counters import FrameCounters


def dropped(counters: dict[str, int]) -> int:
    return sum(count for name, count in counters.items() if name.startswith("dropped."))


def test_a_fresh_ledger_is_all_zero():
    assert FrameCounters().snapshot() == {"received": 0, "processed": 0, "pending": 0}


def test_each_arrival_is_pending_until_it_is_done_or_dropped():
    counters = FrameCounters("captured", "published")
    for _ in range(5):
        counters.arrive()
    counters.finish()
    counters.drop("overwritten")
    counters.drop("corrupt")
    counters.drop("overwritten")
    assert counters.snapshot() == {
        "captured": 5,
        "published": 1,
        "dropped.corrupt": 1,
        "dropped.overwritten": 2,
        "pending": 1,
    }


def test_notes_are_no_part_of_the_balance():
    counters = FrameCounters()
    counters.note("missed", 7)
    counters.note("missed")
    assert counters.snapshot() == {"received": 0, "processed": 0, "pending": 0, "missed": 8}


@pytest.mark.parametrize("threads", [1, 4])
def test_every_snapshot_balances_under_load(threads: int):
    counters = FrameCounters()
    started = threading.Barrier(threads + 1)
    frames = 3000

    def consume(number: int) -> None:
        started.wait()
        for n in range(frames):
            counters.arrive()
            if n % 3 == 0:
                counters.drop(f"reason_{number % 2}")
            else:
                counters.finish()

    workers = [threading.Thread(target=consume, args=(number,)) for number in range(threads)]
    for worker in workers:
        worker.start()
    started.wait()
    snapshots = []
    while any(worker.is_alive() for worker in workers):
        snapshots.append(counters.snapshot())
    for each in snapshots:
        assert each["received"] == each["processed"] + dropped(each) + each["pending"]
        assert 0 <= each["pending"] <= threads
    last = counters.snapshot()
    assert last["received"] == threads * frames
    assert last["processed"] == threads * 2000
    assert dropped(last) == threads * 1000
    assert last["pending"] == 0


@settings(deadline=None)
@given(st.lists(st.integers(0, 2**64 - 1) | st.sampled_from([2**63, 2**64 - 1])))
def test_no_amounts_make_the_diagnostics_invalid(amounts: list[int]):
    counters = FrameCounters()
    for amount in amounts:
        counters.note("missed", amount)
    sent = Health("tracker_front", counters).diagnostics().to_bytes()
    received = Diagnostics.from_bytes(sent).counters
    assert received.get("missed", 0) == min(2**64 - 1, sum(amounts))
