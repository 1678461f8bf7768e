"""A newer item replaces an older one, and each loss is reported."""

from __future__ import annotations

import threading

from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.stream.buffer import MAX_KEYS, Buffer, latest, queue


def test_the_newest_item_replaces_the_waiting_one():
    replaced: list[int] = []
    buffer = Buffer[int](latest, replaced.append)
    for item in range(4):
        buffer.put(item)
    assert replaced == [0, 1, 2]
    assert buffer.take(0) == 3
    assert buffer.take(0) is None


def test_an_item_that_was_taken_is_not_counted_as_replaced():
    replaced: list[int] = []
    buffer = Buffer[int](latest, replaced.append)
    for item in range(4):
        buffer.put(item)
        assert buffer.take(0) == item
    assert replaced == []


def test_an_unverified_item_replaces_no_current_one_and_is_taken_after_it():
    replaced: list[str] = []
    buffer = Buffer[str](latest, replaced.append)
    buffer.put("unverified", unverified=True)
    buffer.put("current")
    assert replaced == []
    assert [buffer.take(0), buffer.take(0), buffer.take(0)] == ["current", "unverified", None]


def test_current_and_unverified_items_are_replaced_separately():
    replaced: list[str] = []
    buffer = Buffer[str](latest, replaced.append)
    buffer.put("current 1")
    buffer.put("unverified 1", unverified=True)
    buffer.put("unverified 2", unverified=True)
    buffer.put("current 2")
    assert replaced == ["unverified 1", "current 1"]
    assert [buffer.take(0), buffer.take(0)] == ["current 2", "unverified 2"]


def test_filled_is_true_for_a_current_and_for_an_unverified_item():
    buffer = Buffer[int](latest, lambda _: None)
    assert not buffer.filled
    buffer.put(0)
    assert buffer.filled
    buffer.take(0)
    buffer.put(0, unverified=True)
    assert buffer.filled
    buffer.take(0)
    assert not buffer.filled


def test_taking_from_an_empty_buffer_returns_none_after_the_timeout():
    assert Buffer[int](latest, lambda _: None).take(0.001) is None


def test_an_item_that_arrives_wakes_the_waiting_thread():
    buffer = Buffer[int](latest, lambda _: None)
    taken: list[int | None] = []
    taker = threading.Thread(target=lambda: taken.append(buffer.take(60)))
    taker.start()
    buffer.put(5)
    taker.join(5)
    assert taken == [5]


def test_the_buffer_is_unlocked_while_the_drop_of_an_item_is_reported():
    """A callback that waits for another thread, which needs the buffer, does not deadlock."""
    seen: list[bool] = []

    def ask_on_another_thread(_item: int) -> None:
        other = threading.Thread(target=lambda: seen.append(buffer.filled), daemon=True)
        other.start()
        other.join(1)
        assert seen == [True]

    buffer = Buffer[int](latest, ask_on_another_thread)
    buffer.put(1)
    buffer.put(2)
    assert seen == [True]


def test_each_item_of_many_threads_is_taken_or_replaced_exactly_once():
    replaced: list[tuple[int, int]] = []
    buffer = Buffer[tuple[int, int]](latest, replaced.append)
    putters, items = 4, 2000

    def put(number: int) -> None:
        for item in range(items):
            buffer.put((number, item), unverified=number == 0)

    threads = [threading.Thread(target=put, args=(number,)) for number in range(putters)]
    for thread in threads:
        thread.start()
    taken = []
    while any(thread.is_alive() for thread in threads) or buffer.filled:
        item = buffer.take(0.001)
        if item is not None:
            taken.append(item)
    for thread in threads:
        thread.join()
    everything = sorted(taken + replaced)
    assert everything == [(number, item) for number in range(putters) for item in range(items)]
    for number in range(putters):  # newest wins: no thread's item is seen after a later one
        mine = [item for putter, item in taken if putter == number]
        assert mine == sorted(mine)


def test_of_several_keys_the_one_that_waits_longest_is_next_whatever_arrives_meanwhile():
    buffer = Buffer[str](latest, lambda _: None)
    buffer.put("a1", "a")
    buffer.put("b1", "b", unverified=True)  # an unverified epoch does not wait for other keys
    buffer.put("a2", "a")
    taken = [buffer.take(0)]
    for number in range(3, 6):
        buffer.put(f"a{number}", "a")
        taken.append(buffer.take(0))
        buffer.put(f"b{number}", "b")
    assert taken == ["a2", "b1", "a4", "b4"]  # in turn, each the newest of its key


def test_a_queue_keeps_the_order_of_arrival_even_if_an_epoch_is_verified_in_between():
    buffer = Buffer[int](queue(10), lambda _: None)
    for number in range(5):
        buffer.put(number, unverified=number < 3)
    assert [buffer.take(0) for _ in range(5)] == [0, 1, 2, 3, 4]


def test_a_queue_is_full_by_bytes_too_and_always_has_room_for_the_newest():
    replaced: list[str] = []
    buffer = Buffer[str](queue(10, max_bytes=100), replaced.append)
    for item, size in (("a", 40), ("b", 40), ("c", 20)):
        buffer.put(item, size=size)
    assert replaced == [], "100 bytes wait"
    buffer.put("d", size=50)
    assert replaced == ["a", "b"], "60 + 50 and then 20 + 50 bytes are left"
    assert buffer.take(0) == "c"
    buffer.put("e", size=50)
    assert replaced == ["a", "b"], "what was taken is out of the count"
    buffer.put("f", size=1000)
    assert replaced == ["a", "b", "d", "e"]
    assert buffer.take(0) == "f"


def test_keys_without_end_cost_bounded_memory_and_the_one_that_waits_longest_goes():
    replaced: list[int] = []
    buffer = Buffer[int](latest, replaced.append)
    for number in range(MAX_KEYS + 2):
        buffer.put(number, f"key/{number}")
    assert replaced == [0, 1]
    assert buffer.take(0) == 2


def test_what_waits_when_a_buffer_is_closed_and_what_comes_later_is_passed_on_once():
    replaced: list[str] = []
    left: list[str] = []
    buffer = Buffer[str](latest, replaced.append)
    buffer.put("a", "a")
    buffer.put("b", "b", unverified=True)
    buffer.close(left.append)
    buffer.put("c", "a")
    assert (left, replaced) == (["a", "b", "c"], [])
    assert not buffer.filled
    assert buffer.take(0) is None


def test_what_was_replaced_before_a_buffer_is_closed_is_not_passed_on_as_left():
    replaced: list[int] = []
    left: list[int] = []

    class CloseOnSecond(Wakeup):
        count = 0

        def set(self) -> None:
            self.count += 1
            if self.count == 2:
                buffer.close(left.append)

    buffer = Buffer[int](latest, replaced.append, CloseOnSecond())
    buffer.put(1)
    buffer.put(2)
    assert (replaced, left) == ([1], [2])


def test_when_there_are_too_many_keys_a_frame_does_not_go_for_an_unverified_one_of_its_key():
    replaced: list[str] = []
    buffer = Buffer[str](latest, replaced.append)
    buffer.put("unverified", "key/0", unverified=True)
    for number in range(1, MAX_KEYS):
        buffer.put("another", f"key/{number}")
    buffer.put("current", "key/0")
    assert replaced == ["unverified"]


def test_when_too_many_bytes_wait_unverified_items_go_first_and_the_newest_item_last():
    replaced: list[str] = []
    buffer = Buffer[str](latest, replaced.append)
    buffer.put("unverified", "a", unverified=True, size=200 << 20)
    buffer.put("a1", "a", size=100 << 20)
    assert replaced == ["unverified"], "300 of 256 MiB"
    buffer.put("b1", "b", size=100 << 20)
    buffer.put("a2", "a", size=200 << 20)
    assert replaced == ["unverified", "a1", "b1"], "200 + 100 of 256 MiB"
    buffer.put("other", "b", unverified=True, size=100 << 20)
    assert replaced == ["unverified", "a1", "b1", "other"], "of an epoch that may be false"
    assert buffer.take(0) == "a2"
    assert not buffer.filled
