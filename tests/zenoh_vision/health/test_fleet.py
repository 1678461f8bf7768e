"""Which nodes are alive, which are gone, and what they counted. Times are arguments."""

from __future__ import annotations

import time
import tracemalloc
from contextlib import suppress

import pytest

from tests.support.node_states import description, node_state, report
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet import (
    GONE_S,
    MAX_COUNTERS,
    MAX_NODES,
    MAX_PARAMETERS,
    MAX_REPORT,
    MAX_REPORTS,
    ClockOffset,
    Fleet,
    NodeState,
    S,
    bounded,
)
from zenoh_vision.health.fleet_monitor import FleetMonitor
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter

FORGET_S = 300.0


def health(node: str, **fields: object) -> Diagnostics:
    return report(node=node, **fields)


def about(node: str, **fields: object) -> NodeDescription:
    return description(node=node, **fields)


@pytest.fixture
def fleet() -> Fleet:
    return Fleet(forget_s=FORGET_S)


def alive(fleet: Fleet, at_s: float) -> dict[str, bool]:
    fleet.expire(int(at_s * S))
    return {node.name: node.alive for node in fleet.nodes()}


def only(fleet: Fleet) -> NodeState:
    (node,) = fleet.nodes()
    return node


# Events


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
    fleet.report("a", health("a"), 1 * S)
    fleet.describe("a", about("a", pid=1))
    fleet.token("a", False, 2 * S)
    assert fleet.to_ask(2 * S, 1.0) == []
    fleet.token("a", True, 3 * S)
    node = only(fleet)
    assert (node.alive, node.since_ns, node.report) == (True, 3 * S, None)
    assert not node.answered
    assert node.description is not None
    assert fleet.to_ask(3 * S, 1.0) == ["a"]
    fleet.describe("a", about("a", pid=2))
    assert only(fleet).answered


def test_last_words_that_come_after_the_end_of_a_token_do_not_revive_a_node(fleet: Fleet):
    fleet.token("a", True, 0)
    fleet.token("a", False, 2 * S)
    fleet.report("a", health("a"), 2 * S + 1)
    assert (only(fleet).alive, only(fleet).report) == (False, None)


def test_a_token_that_comes_after_the_first_words_keeps_them(fleet: Fleet):
    fleet.report("a", health("a", level=1), 0)
    fleet.token("a", True, S // 10)
    assert alive(fleet, 1000.0) == {"a": True}
    assert only(fleet).report is not None


def test_a_node_without_a_token_is_up_while_it_reports(fleet: Fleet):
    fleet.report("a", health("a"), 0)
    assert alive(fleet, GONE_S) == {"a": True}
    assert alive(fleet, GONE_S + 0.1) == {"a": False}
    assert alive(fleet, GONE_S + FORGET_S) == {"a": False}
    fleet.report("a", health("a"), int((GONE_S + FORGET_S) * S))
    assert alive(fleet, GONE_S + FORGET_S) == {"a": True}


def test_a_node_without_a_token_is_forgotten_too(fleet: Fleet):
    fleet.report("a", health("a"), 0)
    assert alive(fleet, GONE_S + FORGET_S + 0.1) == {}


def test_the_end_of_an_unknown_token_is_nothing(fleet: Fleet):
    assert not fleet.token("a", False, 0)
    assert fleet.nodes() == []


def test_what_comes_on_the_key_of_another_node_is_refused(fleet: Fleet):
    with pytest.raises(PayloadError, match="of 'b' on the key of 'a'") as caught:
        fleet.report("a", health("b"), 0)
    assert caught.value.reason == "wrong_node"
    assert fleet.nodes() == []
    fleet.token("a", True, 0)
    with pytest.raises(PayloadError, match="of 'b' on the key of 'a'"):
        fleet.describe("a", about("b"))
    with pytest.raises(PayloadError, match="of 'b' on the key of 'a'"):
        fleet.change_parameter("a", parameter("b", 1.0, 0))


def test_of_a_node_that_is_gone_a_description_is_not_taken(fleet: Fleet):
    fleet.token("b", True, 0)
    fleet.token("b", False, 1 * S)
    assert not fleet.describe("b", about("b"))
    assert alive(fleet, 1.0) == {"b": False}


REAL = ("camera_front", "edge_front", "tracker_front", "viewer")
FAKES = 20_000


def flooded() -> Fleet:
    """Return the state after four nodes came and then thousands of tokens."""
    fleet = Fleet(forget_s=FORGET_S)
    for name in REAL:
        fleet.token(name, True, 0)
        fleet.describe(name, about(name))
    for n in range(FAKES):
        fleet.token(f"fake{n}", True, n)
    return fleet


def test_thousands_of_tokens_push_out_no_node_that_has_described_itself():
    fleet = flooded()
    names = [node.name for node in fleet.nodes()]
    assert set(REAL) < set(names)
    assert len(names) == MAX_NODES
    assert fleet.left_out == FAKES + len(REAL) - MAX_NODES
    assert f"fake{FAKES - 1}" in names  # the oldest went


def test_a_node_that_starts_among_thousands_of_tokens_is_found_by_its_report():
    fleet = flooded()
    fleet.report("camera_left", health("camera_left"), 1 * S)
    for n in range(FAKES):
        fleet.token(f"more{n}", True, 1 * S + n)
    assert fleet.node("camera_left") is not None
    assert fleet.describe("camera_left", about("camera_left"))


def test_a_node_that_was_left_out_comes_back_by_its_description():
    fleet = flooded()
    fleet.token("camera_left", True, 1 * S)
    for n in range(FAKES):
        fleet.token(f"more{n}", True, 1 * S)
    assert fleet.node("camera_left") is None
    assert fleet.describe("camera_left", about("camera_left"), 2 * S)
    for n in range(FAKES):
        fleet.token(f"again{n}", True, 2 * S)
    assert alive(fleet, 1000.0)["camera_left"]


def test_reports_under_thousands_of_names_push_out_no_node_that_has_described_itself():
    fleet = flooded()
    for n in range(FAKES):
        fleet.report(f"liar{n}", health(f"liar{n}"), 1 * S)
    assert set(REAL) < {node.name for node in fleet.nodes()}
    with pytest.raises(PayloadError, match="more than 1000 nodes; 'late'") as caught:
        fleet.token("late", True, 2 * S)  # less than all others
    assert caught.value.reason == "too_many"


def test_after_the_tokens_have_gone_new_nodes_are_taken_again():
    fleet = flooded()
    for n in range(FAKES):
        fleet.token(f"fake{n}", False, 1 * S)
    fleet.token("camera_left", True, 2 * S)
    assert fleet.describe("camera_left", about("camera_left"))
    fleet.expire(int((2 + FORGET_S) * S))
    assert [node.name for node in fleet.nodes()] == sorted([*REAL, "camera_left"])


def test_of_a_full_fleet_only_nodes_that_describe_themselves_are_left():
    fleet = Fleet()
    for n in range(MAX_NODES):
        fleet.token(f"n{n}", True, 0)
        fleet.describe(f"n{n}", about(f"n{n}"))
    with pytest.raises(PayloadError, match="too_many"):
        fleet.report("more", health("more"), 0)
    fleet.token("n7", False, 1 * S)
    with pytest.raises(PayloadError, match="too_many"):
        fleet.report("more", health("more"), 2 * S)  # one that went is worth more, too
    fleet.report("n8", health("n8", level=2), 2 * S)
    assert len(fleet.nodes()) == MAX_NODES


def test_in_a_full_fleet_a_node_that_describes_itself_replaces_one_that_is_gone():
    fleet = Fleet()
    for n in range(MAX_NODES):
        fleet.token(f"n{n}", True, 0)
        fleet.describe(f"n{n}", about(f"n{n}"))
    with pytest.raises(PayloadError, match="too_many"):
        fleet.describe("more", about("more"))
    fleet.token("n7", False, 1 * S)
    assert fleet.describe("more", about("more"), 2 * S)
    assert fleet.node("n7") is None
    assert len(fleet.nodes()) == MAX_NODES


def test_a_snapshot_of_too_many_names_keeps_those_that_answer():
    fakes = [NodeState(f"a_fake{n}", has_token=True) for n in range(FAKES)]
    real = [node_state(name) for name in REAL]
    found, left_out = bounded([*fakes, *real])
    assert [node.name for node in found[: len(REAL)]] == list(REAL)
    assert (len(found), left_out) == (MAX_NODES, FAKES + len(REAL) - MAX_NODES)


def test_names_and_texts_without_end_take_no_memory():
    def flood(fleet: Fleet) -> None:
        for n in range(1500):
            counters = {f"{n}.{c}": c for c in range(100)}
            with suppress(PayloadError):
                fleet.report(f"n{n}", health(f"n{n}", message=20_000 * "x"), 0)
            with suppress(PayloadError):
                fleet.report(f"{n}".zfill(50_000), health(f"{n}".zfill(50_000)), 0)
            fleet.report(f"n{n}", health(f"n{n}", counters=counters, message=100 * "x"), 0)

    fleet = Fleet(window_s=5.0)
    tracemalloc.start()
    flood(fleet)
    held_mb = tracemalloc.get_traced_memory()[0] / 1e6
    tracemalloc.stop()
    assert held_mb < 1.5 * MAX_NODES * MAX_REPORT / 1e6


def test_reports_in_a_flood_take_no_memory_and_the_first_counts():
    fleet = Fleet(window_s=5.0)
    for n in range(1000):
        fleet.report("a", health("a", uptime_s=60 + n / 1000, counters={"received": n}), 0)
    kept = only(fleet).reports
    assert len(kept) == MAX_REPORTS
    change = only(fleet).change
    assert change is not None
    assert (change.arrived, round(change.span_s, 6)) == (999, 0.999)


def test_what_is_too_large_of_a_node_is_refused(fleet: Fleet):
    fleet.token("a", True, 0)
    keys = tuple(f"vision/{n}/image" for n in range(20_000))
    with pytest.raises(PayloadError, match="too_large: the description of 'a'"):
        fleet.describe("a", about("a", publishes=keys))
    with pytest.raises(PayloadError, match="too_large: the report of 'a'"):
        fleet.report("a", health("a", message=MAX_REPORT * "x"), 0)
    with pytest.raises(PayloadError, match="too_large: the name 'bbb"):
        fleet.token(1000 * "b", True, 0)


def test_a_viewer_that_follows_256_keys_can_describe_itself(fleet: Fleet):
    fleet.token("a", True, 0)
    keys = tuple(f"vision/a_long_name_of_a_camera_{n}/mask/compressed" for n in range(256))
    assert fleet.describe("a", about("a", subscribes=keys))


def test_endless_parameters_of_a_node_take_no_memory(fleet: Fleet):
    fleet.token("a", True, 0)
    for n in range(MAX_PARAMETERS):
        assert fleet.change_parameter("a", parameter("a", 1.0, 0, f"p{n}"))
    with pytest.raises(PayloadError, match="too_many: more than 200 parameters of 'a'"):
        fleet.change_parameter("a", parameter("a", 1.0, 0, "more"))
    assert fleet.change_parameter("a", parameter("a", 2.0, 1, "p7"))
    with pytest.raises(PayloadError, match="too_large: the parameter of 'a'"):
        fleet.change_parameter("a", parameter("a", 2.0, 2, "p" * 10_000))
    many = [parameter("a", 1.0, 0, f"q{n}") for n in range(25_000)]
    assert fleet.set_parameters("a", [parameter("a", 1.0, 0, "p" * 10_000), *many])
    assert list(only(fleet).parameters) == [f"q{n}" for n in range(MAX_PARAMETERS)]


@pytest.mark.parametrize("value", ["x" * 7_500, "\N{ROCKET}" * 1_870], ids=["ASCII", "not ASCII"])
def test_all_parameters_of_a_node_are_limited_by_the_memory_that_their_texts_take(
    fleet: Fleet, value: str
):
    fleet.token("a", True, 0)
    large = [parameter("a", value, 0, f"p{n}") for n in range(9)]
    for each in large[:8]:
        assert fleet.change_parameter("a", each)
    with pytest.raises(PayloadError, match="all parameters of 'a' together"):
        fleet.change_parameter("a", large[8])
    assert fleet.change_parameter("a", large[7].model_copy(update={"revision": 1}))
    assert fleet.set_parameters("a", large[::-1])
    assert list(only(fleet).parameters) == [f"p{n}" for n in range(8, 0, -1)]


def test_there_is_a_limit_to_the_counters_of_a_node(fleet: Fleet):
    counters = {f"c{n}": n for n in range(MAX_COUNTERS + 1)}
    with pytest.raises(PayloadError, match="101 counters of 'a'"):
        fleet.report("a", health("a", counters=counters), 0)


def test_nodes_are_in_the_order_of_their_names(fleet: Fleet):
    for node in ("b", "c", "a"):
        fleet.token(node, True, 0)
    assert list(alive(fleet, 0.0)) == ["a", "b", "c"]


def parameter(node: str, value: float | str, revision: int, name: str = "low") -> Parameter:
    return Parameter(
        node=node, name=name, type="float", value=value, default=4.0, revision=revision
    )


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
    for name in ("b", "c"):
        fleet.token(name, True, 1 * S)
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
            fleet.describe(name, about(name))
    assert questions <= 200
    assert replies <= 4 * 200  # asking all each time would be 10,100


def test_a_node_that_does_not_answer_is_asked_again_after_a_while(fleet: Fleet):
    fleet.token("a", True, 0)
    fleet.to_ask(0, 10.0)
    assert fleet.to_ask(9 * S, 10.0) == []
    assert fleet.to_ask(10 * S, 10.0) == ["a"]
    fleet.describe("a", about("a"))
    assert fleet.to_ask(30 * S, 10.0) == []


# What nodes counted


def counting(uptime_s: float, received: int, session: str = "a1") -> NodeState:
    counters = {"received": received, "processed": received, "pending": 0}
    return node_state(session=session, health=report(uptime_s=uptime_s, counters=counters))


def test_a_change_is_over_the_window():
    fleet = Fleet(window_s=5.0)
    for second in range(20):
        fleet.update([counting(second, 30 * second)])
    change = only(fleet).change
    assert change is not None
    assert (change.span_s, change.arrived) == (5.0, 150)


def test_diagnostics_that_come_as_events_make_a_change_too():
    fleet = Fleet(window_s=5.0)
    for second in range(3):
        counters = {"received": 30 * second}
        fleet.report("a", health("a", uptime_s=float(second), counters=counters), second * S)
    change = only(fleet).change
    assert change is not None
    assert (change.span_s, change.arrived) == (2.0, 60)
    fleet.report("a", health("a", uptime_s=0.5, counters={"received": 1}), 3 * S)
    assert only(fleet).change is None  # it was started again


def test_one_report_is_no_change_and_the_same_again_is_none_either():
    fleet = Fleet(window_s=5.0)
    for _ in range(3):
        fleet.update([counting(1, 30)])
    assert only(fleet).change is None


def test_two_nodes_of_one_name_have_a_history_each():
    fleet = Fleet(window_s=5.0)
    for second in range(3):
        fleet.update([counting(second, 30 * second, "a1"), counting(second, 7 * second, "b2")])
    assert [node.change and node.change.arrived for node in fleet.nodes()] == [60, 14]


def test_what_is_there_no_more_is_forgotten():
    fleet = Fleet(window_s=5.0)
    fleet.update([counting(1, 30)])
    fleet.update([])
    fleet.update([counting(2, 60)])
    assert only(fleet).change is None


@pytest.mark.parametrize("later", [29, 0])
def test_counters_that_went_back_say_nothing(later):
    fleet = Fleet(window_s=5.0)
    fleet.update([counting(1, 30)])
    fleet.update([counting(2, later)])
    assert only(fleet).change is None


# Snapshots


def test_who_comes_and_who_goes_is_told_once(fleet: Fleet):
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
    from dataclasses import replace

    for ahead_ns, error_ns in ((5, 300), (7, 100), (9, 200)):
        fleet.update([replace(node_state(), clock=ClockOffset(ahead_ns, error_ns))])
    assert only(fleet).clock == ClockOffset(7, 100)


# The monitor


def test_the_monitor_follows_by_its_own_clock():
    monitor = FleetMonitor(Fleet(forget_s=FORGET_S))
    monitor.take("a", True)
    monitor.take("a", health("a"))
    node = monitor.node("a")
    assert node is not None
    assert node.report_age_s(time.monotonic_ns()) < 5
    monitor.forget("a")
    assert monitor.nodes() == []


def test_a_thousand_nodes_cost_little_more_for_each_than_a_hundred():
    def took_s(count: int) -> float:
        fleet = Fleet(window_s=5.0)
        reports = [health(f"n{n}") for n in range(count)]
        began_s = time.process_time()
        for second in range(3):
            for n, each in enumerate(reports):
                fleet.token(f"n{n}", True, second * S)
                fleet.report(f"n{n}", each, second * S)
            fleet.to_ask(second * S, 1.0)
            fleet.expire(second * S)
            fleet.nodes()
        return (time.process_time() - began_s) / count

    small_s = min(took_s(100) for _ in range(5))
    assert min(took_s(1000) for _ in range(3)) < 4 * small_s
