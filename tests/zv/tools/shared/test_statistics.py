"""Rates, spreads and gaps, against hand-made numbers and the standard library."""

from __future__ import annotations

import random
import statistics

import pytest

from zv.tools.shared.statistics import (
    KEPT,
    MAX_MISSING,
    Distribution,
    Samples,
    SequenceGaps,
)


def spread(values: list[float]) -> dict[str, float]:
    distribution = Distribution()
    for value in values:
        distribution.add(value)
    return distribution.spread()


def test_a_spread_is_that_of_the_standard_library():
    values = random.Random(1).choices(range(1000), k=301)
    found = spread([float(value) for value in values])
    ordered = sorted(values)
    assert found == {
        "min": ordered[0],
        "max": ordered[-1],
        "std": pytest.approx(statistics.pstdev(values)),
        # Nearest rank: the 151st of 301 (150.5 rounded up), the 298th (297.99 rounded up).
        "p50": ordered[150],
        "p99": ordered[297],
    }


def test_a_spread_of_one_value_is_that_value_and_of_none_is_nothing():
    assert spread([3.0]) == {"min": 3, "max": 3, "std": 0, "p50": 3, "p99": 3}
    assert spread([]) == {}


def test_of_many_values_only_the_percentiles_are_estimates():
    values = [float(value) for value in range(10 * KEPT)]
    random.Random(1).shuffle(values)
    distribution = Distribution()
    for value in values:
        distribution.add(value)
    found = distribution.spread()
    assert (found["min"], found["max"]) == (0, 10 * KEPT - 1)
    assert found["std"] == pytest.approx(statistics.pstdev(values))
    # Standard errors of ranks in a sample of 5000: 0.7 % at the median, 0.14 % at the 99th.
    assert found["p50"] == pytest.approx(5 * KEPT, abs=0.035 * 10 * KEPT)
    assert found["p99"] == pytest.approx(9.9 * KEPT, abs=0.007 * 10 * KEPT)
    assert len(distribution._kept) == KEPT


@pytest.mark.parametrize(
    ("times_s", "begin_s", "end_s", "expected"),
    [
        pytest.param([], 0, 5, 0, id="nothing"),
        pytest.param([1], 0, 5, 0, id="one message has no rate"),
        # 4 periods of 0.1 s; the 0.05 s before and after are shorter than one.
        pytest.param([0.05, 0.15, 0.25, 0.35, 0.45], 0, 0.5, 10, id="steady"),
        # 4 periods in 0.4 s, then silent for 0.6 s, of which one period is due: 4 / 0.9.
        pytest.param([0.0, 0.1, 0.2, 0.3, 0.4], 0, 1.0, 4 / 0.9, id="stopped"),
        # It came 0.6 s after one began to listen: 4 / (0.4 + 0.5).
        pytest.param([0.6, 0.7, 0.8, 0.9, 1.0], 0, 1.0, 4 / 0.9, id="came late"),
    ],
)
def test_a_rate_counts_silence_but_not_the_ends_of_a_steady_stream(
    times_s, begin_s, end_s, expected
):
    samples = Samples()
    for time_s in times_s:
        samples.add(time_s, 1, None)
    assert samples.rate_hz(begin_s, end_s) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("seqs", "lost", "repeated"),
    [
        pytest.param([7, 8, 9], 0, 0, id="none missing, wherever it begins"),
        pytest.param([0, 1, 4, 5], 2, 0, id="two in a row"),
        pytest.param([0, 2, 4, 6], 3, 0, id="every other"),
        pytest.param([0, 3, 1], 1, 0, id="one of two came late"),
        pytest.param([0, 1, 1, 2], 0, 1, id="one came twice"),
        pytest.param([0, 3, 1, 1], 1, 1, id="late and twice"),
        pytest.param([0, 10**9, 10**9 + 1], 10**9 - 1, 0, id="too many to remember"),
    ],
)
def test_gaps_in_the_sequence_are_lost(seqs, lost, repeated):
    gaps = SequenceGaps()
    for seq in seqs:
        gaps.add("c", 1, seq)
    assert (gaps.lost, gaps.repeated, gaps.restarts) == (lost, repeated, 0)


def test_one_message_with_a_number_far_ahead_is_not_believed():
    gaps = SequenceGaps()
    for seq in (1, 2**63, 2, 3, 2**64 - 1, 4):
        gaps.add("front", 1, seq)
    assert (gaps.lost, gaps.repeated) == (0, 0)


def test_a_long_gap_counts_when_the_number_after_it_confirms_it():
    gaps = SequenceGaps()
    for seq in (1, 5000, 5002):
        gaps.add("front", 1, seq)
    assert gaps.lost == 4998 + 1  # 2 to 4999, and 5001


def test_a_new_epoch_begins_a_new_count_and_keeps_what_was_lost():
    gaps = SequenceGaps()
    for epoch, seq in [(1, 0), (1, 2), (2, 900), (2, 901), (2, 905)]:
        gaps.add("c", epoch, seq)
    assert (gaps.lost, gaps.restarts) == (1 + 3, 1)


def test_many_epochs_do_not_grow_without_bound_and_nothing_lost_is_forgotten():
    gaps = SequenceGaps()
    for epoch in range(100):
        gaps.add("c", epoch, 0)
        gaps.add("c", epoch, 2)
    assert (gaps.lost, gaps.restarts) == (100, 99)
    assert len(gaps._epochs) < 20


def test_what_is_remembered_of_a_gap_is_bounded():
    gaps = SequenceGaps()
    for seq in (0, 2**64 - 2, 2**64 - 1):
        gaps.add("c", 1, seq)
    assert len(gaps._epochs["c", 1].missing) == MAX_MISSING
    assert gaps.lost == 2**64 - 3
