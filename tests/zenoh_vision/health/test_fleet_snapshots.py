"""Nodes that are found again and again: who came, who went, and what they counted meanwhile."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.support.node_states import node_state, only, report
from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.node_state import ClockOffset, NodeState, S


def counting(uptime_s: float, received: int, session: str = "a1") -> NodeState:
    counters = {"received": received, "processed": received, "pending": 0}
    return node_state(session=session, health=report(uptime_s=uptime_s, counters=counters))


@pytest.fixture
def fleet() -> Fleet:
    return Fleet(window_s=5.0)


def test_a_change_is_over_the_window(fleet: Fleet):
    for second in range(20):
        fleet.update([counting(second, 30 * second)])
    change = only(fleet).change
    assert change is not None
    assert (change.span_s, change.arrived) == (5.0, 150)


def test_diagnostics_that_come_as_events_make_a_change_too(fleet: Fleet):
    for second in range(3):
        counters = {"received": 30 * second}
        fleet.report("a", report(node="a", uptime_s=float(second), counters=counters), second * S)
    change = only(fleet).change
    assert change is not None
    assert (change.span_s, change.arrived) == (2.0, 60)
    fleet.report("a", report(node="a", uptime_s=0.5, counters={"received": 1}), 3 * S)
    assert only(fleet).change is None  # it was started again


def test_two_nodes_of_one_name_have_a_history_each(fleet: Fleet):
    for second in range(3):
        fleet.update([counting(second, 30 * second, "a1"), counting(second, 7 * second, "b2")])
    assert [node.change and node.change.arrived for node in fleet.nodes()] == [60, 14]


@pytest.mark.parametrize(
    "then",
    [
        pytest.param([[counting(1, 30)]] * 2, id="the same again"),
        pytest.param([[], [counting(2, 60)]], id="it was there no more"),
        pytest.param([[counting(2, 29)]], id="counters went back"),
        pytest.param([[counting(2, 0)]], id="counters began anew"),
    ],
)
def test_one_report_alone_is_no_change(fleet: Fleet, then: list[list[NodeState]]):
    for nodes in ([counting(1, 30)], *then):
        fleet.update(nodes)
    assert only(fleet).change is None


# Snapshots


def test_nodes_that_appear_and_disappear_are_returned_once(fleet: Fleet):
    front, left = node_state(), node_state("tracker_left", "b2")
    assert fleet.update([front]) == ([front], [])
    assert fleet.update([front, left]) == ([left], [])
    assert fleet.update([left]) == ([], [front])
    assert fleet.update([left]) == ([], [])


def test_a_node_that_does_not_answer_once_has_not_gone(fleet: Fleet):
    fleet.update([node_state()])
    assert fleet.update([NodeState("tracker_front")]) == ([], [])
    assert not only(fleet).answered
    assert only(fleet).description is not None
    assert fleet.update([node_state()]) == ([], [])
    assert only(fleet).answered


def test_a_node_that_never_answered_is_one_that_goes_when_another_answers(fleet: Fleet):
    silent = NodeState("tracker_front")
    assert fleet.update([silent]) == ([silent], [])
    assert fleet.update([node_state()]) == ([node_state()], [silent])


def test_a_second_node_of_a_name_comes_and_goes_by_itself(fleet: Fleet):
    first, second = node_state(session="a1"), node_state(session="b2")
    fleet.update([first])
    assert fleet.update([first, second]) == ([second], [])
    assert fleet.update([second]) == ([], [first])


def test_of_several_measurements_of_a_clock_the_most_exact_is_kept(fleet: Fleet):
    for ahead_ns, error_ns in ((5, 300), (7, 100), (9, 200)):
        fleet.update([replace(node_state(), clock=ClockOffset(ahead_ns, error_ns))])
    assert only(fleet).clock == ClockOffset(7, 100)
