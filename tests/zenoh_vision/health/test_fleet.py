"""Which nodes are alive, gone, or to be asked, and what they count. Times are arguments."""

from __future__ import annotations

import time
from contextlib import closing

import pytest

from tests.support.node_states import FORGET_S, alive, description, only, parameter, report
from tests.support.waiting import wait_until
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.counter_change import CounterChange, counter_change, losses
from zenoh_vision.health.fleet import GONE_S, Fleet
from zenoh_vision.health.fleet_monitor import FleetMonitor
from zenoh_vision.health.node_state import S
from zenoh_vision.testing import at, running_router
from zenoh_vision.transport.link import Link


def test_a_node_with_a_token_is_up_however_long_it_says_nothing(fleet: Fleet):
    fleet.token("a", True, 0)
    assert alive(fleet, 10_000.0) == {"a": True}


def test_a_node_that_went_is_down_for_a_while_and_then_forgotten(fleet: Fleet):
    fleet.token("a", True, 0)
    fleet.token("a", False, 10 * S)
    assert alive(fleet, 10.0) == {"a": False}
    assert alive(fleet, 10.0 + FORGET_S) == {"a": False}
    assert alive(fleet, 10.1 + FORGET_S) == {}


def test_a_node_that_comes_back_begins_anew_but_is_shown_as_it_was_until_it_answers(fleet: Fleet):
    fleet.token("a", True, 0)
    fleet.report("a", report("a"), 1 * S)
    fleet.describe("a", description("a", pid=1))
    fleet.token("a", False, 2 * S)
    assert fleet.to_ask(2 * S, 1.0) == []
    fleet.token("a", True, 3 * S)
    node = only(fleet)
    assert (node.alive, node.since_ns, node.report) == (True, 3 * S, None)
    assert not node.answered
    assert node.description is not None
    assert fleet.to_ask(3 * S, 1.0) == ["a"]
    fleet.describe("a", description("a", pid=2))
    assert only(fleet).answered


def test_last_words_that_come_after_the_end_of_a_token_do_not_revive_a_node(fleet: Fleet):
    fleet.token("a", True, 0)
    fleet.token("a", False, 2 * S)
    fleet.report("a", report("a"), 2 * S + 1)
    assert (only(fleet).alive, only(fleet).report) == (False, None)


def test_a_token_that_comes_after_the_first_words_keeps_them(fleet: Fleet):
    fleet.report("a", report("a", level=1), 0)
    fleet.token("a", True, S // 10)
    assert alive(fleet, 1000.0) == {"a": True}
    assert only(fleet).report is not None


def test_a_node_without_a_token_is_up_while_it_reports(fleet: Fleet):
    fleet.report("a", report("a"), 0)
    assert alive(fleet, GONE_S) == {"a": True}
    assert alive(fleet, GONE_S + 0.1) == {"a": False}
    assert alive(fleet, GONE_S + FORGET_S) == {"a": False}
    fleet.report("a", report("a"), int((GONE_S + FORGET_S) * S))
    assert alive(fleet, GONE_S + FORGET_S) == {"a": True}
    assert alive(fleet, 2 * (GONE_S + FORGET_S) + 0.1) == {}


def test_what_comes_on_the_key_of_another_node_is_refused(fleet: Fleet):
    with pytest.raises(PayloadError, match="of 'b' on the key of 'a'") as caught:
        fleet.report("a", report("b"), 0)
    assert caught.value.reason == "wrong_node"
    assert not fleet.token("a", False, 0)  # the end of one that was never there
    assert fleet.nodes() == []
    fleet.token("a", True, 0)
    with pytest.raises(PayloadError, match="of 'b' on the key of 'a'"):
        fleet.describe("a", description("b"))
    with pytest.raises(PayloadError, match="of 'b' on the key of 'a'"):
        fleet.change_parameter("a", parameter("b", 1.0, 0))


def test_of_a_node_that_is_gone_a_description_is_not_taken(fleet: Fleet):
    fleet.token("b", True, 0)
    fleet.token("b", False, 1 * S)
    assert not fleet.describe("b", description("b"))
    assert alive(fleet, 1.0) == {"b": False}


def test_of_two_changes_of_a_parameter_the_later_revision_holds(fleet: Fleet):
    assert not fleet.change_parameter("a", parameter("a", 1.0, 0))  # there is no such node
    fleet.token("a", True, 0)
    assert fleet.set_parameters("a", [parameter("a", 4.0, 0)])
    assert not fleet.set_parameters("a", [parameter("a", 4.0, 0)])
    assert fleet.change_parameter("a", parameter("a", 9.0, 2))
    assert not fleet.change_parameter("a", parameter("a", 5.0, 1))
    assert only(fleet).parameters["low"].value == 9.0


# Whom to ask for a description


def test_one_new_node_is_asked_by_its_name_and_several_are_asked_together(fleet: Fleet):
    fleet.token("a", True, 0)
    assert fleet.to_ask(0, 10.0) == ["a"]
    for name in ("c", "b"):
        fleet.token(name, True, 1 * S)
    assert list(alive(fleet, 1.0)) == ["a", "b", "c"]
    assert fleet.to_ask(1 * S, 10.0) == ["*"]
    assert fleet.to_ask(2 * S, 10.0) == []


def test_nodes_that_come_one_after_the_other_are_asked_a_number_of_times_linear_in_them(
    fleet: Fleet,
):
    questions = replies = 0
    for second in range(100):
        for name in (f"n{second:02}a", f"n{second:02}b"):
            fleet.token(name, True, second * S)
        asked = fleet.to_ask(second * S, 10.0)
        questions += len(asked)
        names = [node.name for node in fleet.nodes()] if asked == ["*"] else asked
        replies += len(names)
        for name in names:
            fleet.describe(name, description(name))
    assert questions <= 200
    assert replies <= 4 * 200  # asking all each time would be 10,100


def test_a_node_that_does_not_answer_is_asked_again_after_a_while(fleet: Fleet):
    fleet.token("a", True, 0)
    fleet.to_ask(0, 10.0)
    assert fleet.to_ask(9 * S, 10.0) == []
    assert fleet.to_ask(10 * S, 10.0) == ["a"]
    fleet.describe("a", description("a"))
    assert fleet.to_ask(30 * S, 10.0) == []


# The monitor


def test_the_monitor_follows_by_its_own_clock():
    monitor = FleetMonitor(Fleet(forget_s=FORGET_S))
    monitor.take("a", True)
    monitor.take("a", report("a"))
    node = monitor.node("a")
    assert node is not None
    assert node.report_age_s(time.monotonic_ns()) < 5
    monitor.forget("a")
    assert monitor.nodes() == []


def test_what_is_put_on_the_keys_of_many_nodes_is_refused_and_counted():
    monitor = FleetMonitor(Fleet())
    with (
        running_router() as endpoint,
        closing(Link(at(endpoint))) as link,
        closing(Link(at(endpoint))) as other,
    ):
        monitor.watch(link, "vision", "diagnostics")

        def is_counted(key: str, count: int) -> bool:
            other.session.put(key, report("a").to_bytes())
            return monitor.rejected().get("wrong_node", 0) >= count

        wait_until(lambda: is_counted("@vision/**", 1))
        wait_until(lambda: is_counted("@vision/diagnostics/*", 3))
    assert monitor.nodes() == []


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
        span_s=2.0, arrived=60, losses={"missed": 20, "stale": 10, "corrupt": 1}
    )


def test_the_share_lost_is_of_all_frames_that_there_were():
    change = counter_change(BEFORE, AFTER, 2.0)
    assert change is not None
    assert change.lost == pytest.approx(31 / 80)  # 60 arrived, 20 never did
    assert change.share("stale") == pytest.approx(10 / 80)
    assert change.share("overwritten") == 0.0
    nothing = counter_change(BEFORE, BEFORE, 1.0)
    assert nothing is not None
    assert nothing.lost == 0.0


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
    assert (change.arrived, change.losses) == (30, {"overwritten": 3})
    assert change.lost == pytest.approx(0.1)


def test_counters_that_went_back_are_those_of_another_run():
    assert counter_change(AFTER, BEFORE, 2.0) is None


def test_reasons_stand_with_the_most_frequent_first():
    counted = {"dropped.stale": 2, "dropped.corrupt": 5, "dropped.empty": 0, "missed": 3}
    assert list(losses(counted).items()) == [("corrupt", 5), ("missed", 3), ("stale", 2)]
