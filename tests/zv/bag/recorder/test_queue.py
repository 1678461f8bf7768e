"""The recorder's queue hands over what fits and what does not in the order of arrival."""

from __future__ import annotations

from zv.bag.record import Record
from zv.bag.recorder.queue import RECORD_BYTES, RecordQueue


def test_what_does_not_fit_stands_at_its_place_without_its_bytes():
    queue = RecordQueue(2 * RECORD_BYTES + 100)
    for number, size in enumerate((60, 50, 40)):
        queue.put(Record(f"a/{number}", bytes(size), attachment=b"", log_time_ns=number))
    assert queue.lost == 1
    taken = queue.take(0.0)
    found = [(record.key, len(record.payload), fits) for record, fits in taken]
    assert found == [("a/0", 60, True), ("a/1", 0, False), ("a/2", 40, True)]
    assert queue.lost == 0


def test_there_is_room_again_once_what_was_taken_is_done():
    queue = RecordQueue(RECORD_BYTES + 10)
    for _ in range(2):
        queue.put(Record("a", bytes(10)))
    taken = queue.take(0.0)
    queue.put(Record("a", bytes(10)))
    queue.done(taken)
    queue.put(Record("a", bytes(10)))
    assert [fits for _, fits in taken] == [True, False]
    assert [fits for _, fits in queue.take(0.0)] == [False, True]
