"""Thousands of nodes, and texts without end: what is kept of them, and what it costs."""

from __future__ import annotations

import time
import tracemalloc
from contextlib import suppress

import pytest

from tests.support.node_states import (
    FORGET_S,
    alive,
    description,
    node_state,
    only,
    parameter,
    report,
)
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet import MAX_NODES, Fleet, bounded
from zenoh_vision.health.message_limits import MAX_COUNTERS, MAX_PARAMETERS, MAX_REPORT
from zenoh_vision.health.node_state import MAX_REPORTS, NodeState, S

REAL = ("camera_front", "edge_front", "tracker_front", "viewer")
FAKES = 20_000


def flooded() -> Fleet:
    """Return the state after four nodes came and then thousands of tokens."""
    fleet = Fleet(forget_s=FORGET_S)
    for name in REAL:
        fleet.token(name, True, 0)
        fleet.describe(name, description(name))
    for n in range(FAKES):
        fleet.token(f"fake{n}", True, n)
    return fleet


def full() -> Fleet:
    """Return a fleet of as many nodes as there may be, all of which have described themselves."""
    fleet = Fleet()
    for n in range(MAX_NODES):
        fleet.token(f"n{n}", True, 0)
        fleet.describe(f"n{n}", description(f"n{n}"))
    return fleet


def test_thousands_of_tokens_push_out_no_node_that_has_described_itself():
    fleet = flooded()
    names = [node.name for node in fleet.nodes()]
    assert set(REAL) < set(names)
    assert len(names) == MAX_NODES
    assert fleet.left_out == FAKES + len(REAL) - MAX_NODES
    assert f"fake{FAKES - 1}" in names  # the oldest went


def test_a_node_that_starts_among_thousands_of_tokens_is_found_by_what_it_says():
    fleet = flooded()
    fleet.token("camera_left", True, 1 * S)
    fleet.report("camera_right", report("camera_right"), 1 * S)
    for n in range(FAKES):
        fleet.token(f"more{n}", True, 1 * S + n)
    assert fleet.node("camera_left") is None
    assert fleet.node("camera_right") is not None
    for name in ("camera_left", "camera_right"):
        assert fleet.describe(name, description(name), 2 * S)
    for n in range(FAKES):
        fleet.token(f"again{n}", True, 2 * S)
    assert alive(fleet, 1000.0)["camera_left"]


def test_reports_under_thousands_of_names_push_out_no_node_that_has_described_itself():
    fleet = flooded()
    for n in range(FAKES):
        fleet.report(f"liar{n}", report(f"liar{n}"), 1 * S)
    assert set(REAL) < {node.name for node in fleet.nodes()}
    with pytest.raises(PayloadError, match="more than 1000 nodes; 'late'") as caught:
        fleet.token("late", True, 2 * S)  # less than all others
    assert caught.value.reason == "too_many"


def test_after_the_tokens_have_gone_new_nodes_are_taken_again():
    fleet = flooded()
    for n in range(FAKES):
        fleet.token(f"fake{n}", False, 1 * S)
    fleet.token("camera_left", True, 2 * S)
    assert fleet.describe("camera_left", description("camera_left"))
    fleet.expire(int((2 + FORGET_S) * S))
    assert [node.name for node in fleet.nodes()] == sorted([*REAL, "camera_left"])


def test_of_a_full_fleet_only_nodes_that_describe_themselves_are_left():
    fleet = full()
    with pytest.raises(PayloadError, match="too_many"):
        fleet.report("more", report("more"), 0)
    fleet.token("n7", False, 1 * S)
    with pytest.raises(PayloadError, match="too_many"):
        fleet.report("more", report("more"), 2 * S)  # one that went is worth more, too
    fleet.report("n8", report("n8", level=2), 2 * S)
    assert len(fleet.nodes()) == MAX_NODES


def test_in_a_full_fleet_a_node_that_describes_itself_replaces_one_that_is_gone():
    fleet = full()
    with pytest.raises(PayloadError, match="too_many"):
        fleet.describe("more", description("more"))
    fleet.token("n7", False, 1 * S)
    assert fleet.describe("more", description("more"), 2 * S)
    assert fleet.node("n7") is None
    assert len(fleet.nodes()) == MAX_NODES


def test_a_snapshot_of_too_many_names_keeps_those_that_answer():
    fakes = [NodeState(f"a_fake{n}", has_token=True) for n in range(FAKES)]
    real = [node_state(name) for name in REAL]
    found, left_out = bounded([*fakes, *real])
    assert [node.name for node in found[: len(REAL)]] == list(REAL)
    assert (len(found), left_out) == (MAX_NODES, FAKES + len(REAL) - MAX_NODES)


def test_names_and_texts_without_end_take_no_memory():
    fleet = Fleet(window_s=5.0)
    tracemalloc.start()
    for n in range(1500):
        counters = {f"{n}.{c}": c for c in range(100)}
        with suppress(PayloadError):
            fleet.report(f"n{n}", report(f"n{n}", message=20_000 * "x"), 0)
        with suppress(PayloadError):
            fleet.report(f"{n}".zfill(50_000), report(f"{n}".zfill(50_000)), 0)
        fleet.report(f"n{n}", report(f"n{n}", counters=counters, message=100 * "x"), 0)
    held_mb = tracemalloc.get_traced_memory()[0] / 1e6
    tracemalloc.stop()
    assert held_mb < 1.5 * MAX_NODES * MAX_REPORT / 1e6


def test_reports_in_a_flood_take_no_memory_and_the_first_counts():
    fleet = Fleet(window_s=5.0)
    for n in range(1000):
        fleet.report("a", report("a", uptime_s=60 + n / 1000, counters={"received": n}), 0)
    kept = only(fleet).reports
    assert len(kept) == MAX_REPORTS
    change = only(fleet).change
    assert change is not None
    assert (change.arrived, round(change.span_s, 6)) == (999, 0.999)


def test_what_is_too_large_of_a_node_is_refused(fleet: Fleet):
    fleet.token("a", True, 0)
    keys = tuple(f"vision/{n}/image" for n in range(20_000))
    with pytest.raises(PayloadError, match="too_large: the description of 'a'"):
        fleet.describe("a", description("a", publishes=keys))
    with pytest.raises(PayloadError, match="too_large: the report of 'a'"):
        fleet.report("a", report("a", message=MAX_REPORT * "x"), 0)
    counters = {f"c{n}": n for n in range(MAX_COUNTERS + 1)}
    with pytest.raises(PayloadError, match="101 counters of 'a'"):
        fleet.report("a", report("a", counters=counters), 0)
    with pytest.raises(PayloadError, match="too_large: the name 'bbb"):
        fleet.token(1000 * "b", True, 0)
    keys = tuple(f"vision/a_long_name_of_a_camera_{n}/mask/compressed" for n in range(256))
    assert fleet.describe("a", description("a", subscribes=keys))  # as a viewer that follows them


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


def test_a_thousand_nodes_cost_little_more_for_each_than_a_hundred():
    def took_s(count: int) -> float:
        fleet = Fleet(window_s=5.0)
        reports = [report(f"n{n}") for n in range(count)]
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
