"""Which items of two streams are a pair, which stay alone, and when."""

from __future__ import annotations

import itertools
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from zenoh_vision.stream import pairing
from zenoh_vision.stream.pairing import PairBuffer

MS = 1_000_000
L, R = 0, 1


class Bench:
    """A buffer that takes items named by side and stamp: ``L0`` is the left one at 0 ms."""

    def __init__(self, tolerance_ms: int = 10, wait_ms: int = 500, depth: int = 20) -> None:
        self.buffer = PairBuffer[str](tolerance_ms * MS, wait_ms * MS, depth)

    def put(self, *names: str, at_ms: float = 0, size: int = 0) -> None:
        for name in names:
            self.buffer.put("LR".index(name[0]), int(name[1:]) * MS, name, int(at_ms * MS), size)

    def take(self, at_ms: float = 0) -> list[Any]:
        return list(self.buffer.take(int(at_ms * MS)))


def test_items_within_the_tolerance_are_a_pair_whichever_comes_first():
    for names in (("L0", "R10"), ("R10", "L0"), ("L10", "R0"), ("R0", "L10")):
        bench = Bench(tolerance_ms=10)
        bench.put(*names)
        ((left, right),) = bench.take()
        assert {left, right} == set(names)
        assert left.startswith("L")


def test_an_item_beyond_the_tolerance_stays_alone_as_soon_as_that_is_certain():
    bench = Bench(tolerance_ms=10)
    bench.put("L0")
    assert bench.take(400) == []  # its partner may still come
    bench.put("R11", at_ms=401)
    assert bench.take(401) == [("L0", None)]
    bench.put("L20", at_ms=402)
    assert bench.take(402) == [("L20", "R11")]


def test_without_tolerance_only_equal_stamps_are_a_pair():
    bench = Bench(tolerance_ms=0)
    bench.put("L0", "L33", "R33", "R66", "L66")
    assert bench.take() == [("L0", None), ("L33", "R33"), ("L66", "R66")]


def test_an_item_is_in_one_pair_at_most_and_the_oldest_pair_comes_first():
    bench = Bench(tolerance_ms=10)
    bench.put("L0", "L33", "L66", "R1", "R2", "R34", "R67")
    assert bench.take() == [("L0", "R1"), (None, "R2"), ("L33", "R34"), ("L66", "R67")]


def test_a_nearer_item_that_has_arrived_gets_the_partner():
    bench = Bench(tolerance_ms=50)
    bench.put("L0", "L42", "R40")
    assert bench.take() == [("L0", None), ("L42", "R40")]
    bench.put("L100", "L142", "R110")  # the earlier one is nearer
    assert bench.take() == [("L100", "R110")]


def test_the_items_of_one_stream_go_on_alone_when_the_other_has_died():
    bench = Bench(wait_ms=500)
    for n in range(30):
        bench.put(f"L{33 * n}", at_ms=33 * n)
        found = bench.take(33 * n)
        # After 500 ms, 15.15 frames, each waits for 16 of them.
        assert found == ([] if n < 16 else [(f"L{33 * (n - 16)}", None)])
    bench.put("R957", at_ms=990)  # back: the last one of the other still waits
    assert bench.take(990)[-1] == ("L957", "R957")


def test_no_more_than_the_depth_wait():
    bench = Bench(depth=3)
    bench.put("L0", "L1", "L2", "L3", "L4")
    assert bench.take() == [("L0", None), ("L1", None)]
    assert bench.buffer.clear() == ["L2", "L3", "L4"]


def test_no_more_than_the_bytes_wait_but_the_newest_always():
    bench = Bench()
    bench.put("L0", "L1", "L2", size=pairing.WAITING_BYTES // 2)
    assert bench.take() == [("L0", None)]
    bench.put("L3", size=10 * pairing.WAITING_BYTES)
    assert bench.take() == [("L1", None), ("L2", None)]
    assert bench.buffer.clear() == ["L3"]


def test_a_stamp_of_tomorrow_keeps_the_true_ones_away_only_until_the_next_one():
    bench = Bench()
    bench.put("L86400000", "R0", "R33")
    assert bench.take() == [(None, "R0"), (None, "R33")]
    bench.put("L66", "R66")
    assert bench.take() == [("L86400000", None), ("L66", "R66")]


streams = st.lists(
    st.tuples(st.sampled_from([L, R]), st.integers(0, 300), st.integers(0, 40)), max_size=60
)


@settings(derandomize=True, deadline=None, database=None, max_examples=300)
@given(streams, st.integers(0, 60), st.integers(0, 400), st.integers(1, 8))
def test_whatever_comes_each_item_is_handed_out_once_and_pairs_are_close(
    arrivals, tolerance, wait, depth
):
    buffer = PairBuffer[tuple[int, int, int]](tolerance, wait, depth)
    put: list[tuple[int, int, int]] = []
    found: list[tuple[Any, Any]] = []
    now = 0
    for number, (side, stamp, pause) in enumerate(arrivals):
        now += pause
        item = (side, stamp, number)
        put.append(item)
        buffer.put(side, stamp, item, now)
        found += buffer.take(now)
    found += buffer.take(now + wait)
    assert sorted(each for pair in found for each in pair if each) == sorted(put)
    assert buffer.clear() == []
    for left, right in found:
        if left and right:
            assert (left[0], right[0]) == (L, R)
            assert abs(left[1] - right[1]) <= tolerance


@settings(derandomize=True, deadline=None, database=None, max_examples=200)
@given(st.sets(st.integers(0, 40)), st.sets(st.integers(0, 40)), st.integers(0, 3))
def test_of_two_regular_streams_with_gaps_exactly_the_common_frames_are_pairs(lost, gone, jitter):
    # 33 ms apart, jitter far below half of that: whichever frames are missing, the same numbers
    # belong together.
    bench = Bench(tolerance_ms=15, wait_ms=10_000, depth=40)
    for n in range(40):
        if n not in lost:
            bench.put(f"L{33 * n}")
        if n not in gone:
            bench.put(f"R{33 * n + jitter}")
    pairs = [pair for pair in bench.take() if None not in pair]
    common = [n for n in range(40) if n not in lost and n not in gone]
    assert pairs == [(f"L{33 * n}", f"R{33 * n + jitter}") for n in common]
    stamps = [int(left[1:]) for left, _ in pairs]
    assert all(a < b for a, b in itertools.pairwise(stamps))
