"""The newest item wins, and nothing is lost without a word."""

from __future__ import annotations

import threading

from common.slot import Slot


def test_the_newest_item_displaces_the_one_that_waits():
    replaced: list[int] = []
    slot = Slot[int](replaced.append)
    for item in range(4):
        slot.put(item)
    assert replaced == [0, 1, 2]
    assert slot.take(0) == 3
    assert slot.take(0) is None


def test_an_item_that_was_taken_displaces_nothing():
    replaced: list[int] = []
    slot = Slot[int](replaced.append)
    for item in range(4):
        slot.put(item)
        assert slot.take(0) == item
    assert replaced == []


def test_a_challenger_waits_beside_the_current_stream_and_behind_it():
    replaced: list[str] = []
    slot = Slot[str](replaced.append)
    slot.put("challenger", challenger=True)
    slot.put("current")
    assert replaced == []
    assert [slot.take(0), slot.take(0), slot.take(0)] == ["current", "challenger", None]


def test_each_lane_has_one_place():
    replaced: list[str] = []
    slot = Slot[str](replaced.append)
    slot.put("current 1")
    slot.put("challenger 1", challenger=True)
    slot.put("challenger 2", challenger=True)
    slot.put("current 2")
    assert replaced == ["challenger 1", "current 1"]
    assert [slot.take(0), slot.take(0)] == ["current 2", "challenger 2"]


def test_filled_says_whether_an_item_waits_in_either_lane():
    slot = Slot[int](lambda _: None)
    assert not slot.filled
    slot.put(0)
    assert slot.filled
    slot.take(0)
    slot.put(0, challenger=True)
    assert slot.filled
    slot.take(0)
    assert not slot.filled


def test_taking_from_an_empty_slot_ends_after_the_time_given():
    assert Slot[int](lambda _: None).take(0.001) is None


def test_an_item_that_comes_wakes_the_one_who_waits():
    slot = Slot[int](lambda _: None)
    taken: list[int | None] = []
    taker = threading.Thread(target=lambda: taken.append(slot.take(60)))
    taker.start()
    slot.put(5)
    taker.join(5)
    assert taken == [5]


def test_the_slot_is_free_while_someone_is_told_of_a_displaced_item():
    """A callback that waits for another thread, which needs the slot, does not deadlock."""
    seen: list[bool] = []

    def ask_on_another_thread(_item: int) -> None:
        other = threading.Thread(target=lambda: seen.append(slot.filled), daemon=True)
        other.start()
        other.join(1)
        assert seen == [True]

    slot = Slot[int](ask_on_another_thread)
    slot.put(1)
    slot.put(2)
    assert seen == [True]


def test_items_of_many_threads_are_each_taken_or_displaced_exactly_once():
    replaced: list[tuple[int, int]] = []
    slot = Slot[tuple[int, int]](replaced.append)
    putters, items = 4, 2000

    def put(number: int) -> None:
        for item in range(items):
            slot.put((number, item), challenger=number == 0)

    threads = [threading.Thread(target=put, args=(number,)) for number in range(putters)]
    for thread in threads:
        thread.start()
    taken = []
    while any(thread.is_alive() for thread in threads) or slot.filled:
        item = slot.take(0.001)
        if item is not None:
            taken.append(item)
    for thread in threads:
        thread.join()
    everything = sorted(taken + replaced)
    assert everything == [(number, item) for number in range(putters) for item in range(items)]
    for number in range(putters):  # newest wins: no thread's item is seen after a later one
        mine = [item for who, item in taken if who == number]
        assert mine == sorted(mine)
