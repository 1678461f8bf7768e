"""What a node's counters did between two reports; expected numbers by hand."""

import pytest

from zenoh_vision.health.counter_change import CounterChange, counter_change, losses

BEFORE = {"received": 100, "processed": 90, "dropped.stale": 6, "pending": 4, "missed": 2}
AFTER = {
    "received": 160,
    "processed": 142,
    "dropped.corrupt": 1,
    "dropped.stale": 16,
    "pending": 1,
    "missed": 22,
}


def test_a_change_is_the_difference_of_the_counters_and_a_new_reason_starts_at_0():
    assert counter_change(BEFORE, AFTER, 2.0) == CounterChange(
        span_s=2.0, arrived=60, done=52, losses={"missed": 20, "stale": 10, "corrupt": 1}
    )


def test_the_share_lost_is_of_all_frames_that_there_were():
    change = counter_change(BEFORE, AFTER, 2.0)
    assert change is not None
    assert change.lost == pytest.approx(31 / 80)  # 60 arrived, 20 never did
    assert change.share("stale") == pytest.approx(10 / 80)
    assert change.share("overwritten") == 0.0


def test_at_a_camera_what_nobody_wanted_is_no_loss():
    before = {"captured": 0, "published": 0, "pending": 0}
    after = {
        "captured": 30,
        "published": 10,
        "dropped.no_subscriber": 17,
        "dropped.overwritten": 3,
        "pending": 0,
    }
    change = counter_change(before, after, 1.0)
    assert change is not None
    assert (change.arrived, change.done, change.losses) == (30, 10, {"overwritten": 3})
    assert change.lost == pytest.approx(0.1)


def test_counters_that_went_back_are_those_of_another_run():
    assert counter_change(AFTER, BEFORE, 2.0) is None


def test_nothing_arrived_is_nothing_lost():
    change = counter_change(BEFORE, BEFORE, 1.0)
    assert change is not None
    assert change.lost == 0.0


def test_reasons_stand_with_the_most_frequent_first():
    counted = {"dropped.stale": 2, "dropped.corrupt": 5, "dropped.empty": 0, "missed": 3}
    assert list(losses(counted).items()) == [("corrupt", 5), ("missed", 3), ("stale", 2)]
