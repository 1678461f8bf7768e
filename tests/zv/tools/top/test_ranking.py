"""zv top shows those that hurt first: by level, then by losses, then by latency."""

import os
import socket

import psutil
import pytest

from tests.support.node_states import NOW_NS, S, node_state, report
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Latency
from zv.tools.top.ranking import Ranked, Ranking, record_of, rows_of


def node(name: str, lost: float = 0.0, **health: object) -> Ranked:
    """Return a node that has lost a share of its last 1000 frames."""
    before = report(uptime_s=55.0, counters={"received": 0}, **health)
    counters = {"received": 1000, "dropped.stale": int(1000 * lost)}
    state = node_state(name, health=before)
    return Ranked(state.with_report(report(counters=counters, **health), 0, 5.0))


ORDER = [
    Ranked(NodeState("does_not_answer")),
    node("error", level=2),
    node("stale_and_losing", 0.5, level=3),
    node("stale", level=3),
    node("silent", stamp_ns=NOW_NS - 4 * S),
    node("warns", level=1),
    node("loses_much", 0.2, latency_ms=Latency(p50=1.0, p99=1.0)),
    node("loses_little", 0.01, latency_ms=Latency(p50=80.0, p99=99.0)),
    node("late", latency_ms=Latency(p50=80.0, p99=99.0)),
    node("a_quick_one"),
    node("b_quick_one"),
    node("no_frame_yet", latency_ms=Latency(p50=None, p99=None)),
]


def test_what_hurts_more_stands_first():
    mixed = ORDER[::-1]
    names = [each.node.name for each in sorted(mixed, key=lambda each: each.rank)]
    expected = [each.node.name for each in ORDER]
    assert names == [*expected[:3], "silent", "stale", *expected[5:]]  # these two hurt the same


def test_the_state_says_what_is_wrong():
    states = {row.node: row.state for row in rows_of(ORDER)}
    assert states["does_not_answer"] == "no answer"
    assert states["silent"] == "silent for 4 s"
    assert states["error"] == "ERROR"
    assert states["late"] == "running"


def test_losses_are_shown_in_percent_and_hosts_only_if_there_are_several():
    (row,) = rows_of([node("tracker_front", 0.123)])
    assert (row.lost, row.host) == ("12.3", "")
    here = Ranked(node_state("camera_front", host="attic"))
    assert [row.host for row in rows_of([node("tracker_front"), here])] == ["roof", "attic"]


def test_two_nodes_of_one_name_are_told_apart():
    twins = [Ranked(node_state("camera_front", s, pid=p)) for s, p in (("a", 7), ("b", 8))]
    assert [row.node for row in rows_of(twins)] == ["camera_front (7)", "camera_front (8)"]


def test_a_record_has_numbers_where_the_table_has_text():
    record = record_of(node("tracker_front", 0.25))
    assert (record["lost"], record["losses"]) == (0.25, {"stale": 250})
    assert record["latency_ms"] == {"p50": 5.0, "p99": 9.0}
    assert record["level"] == "OK"


def test_cpu_and_memory_are_those_of_this_machines_processes():
    created_ns = int(psutil.Process().create_time() * 1e9)
    here = node_state(
        "camera_front", host=socket.gethostname(), pid=os.getpid(), started_ns=created_ns + S
    )
    there = node_state("tracker_front", pid=os.getpid())
    ranking = Ranking()
    ranking.update([here, there])
    figures = {each.node.name: each for each in ranking.update([here, there])}
    assert figures["camera_front"].memory_mb is not None
    assert figures["camera_front"].memory_mb > 1
    assert figures["tracker_front"].memory_mb is None


def test_a_process_that_has_an_id_again_is_not_taken_for_the_node():
    here = node_state(host=socket.gethostname(), pid=os.getpid(), started_ns=5 * S)
    ranking = Ranking()
    ranking.update([here])
    assert ranking.update([here])[0].memory_mb is None


@pytest.mark.parametrize("order", [ORDER, ORDER[::-1]])
def test_the_ranking_sorts(order):
    ranked = Ranking().update([each.node for each in order])
    assert ranked[0].node.name == "does_not_answer"
    assert ranked[1].node.name == "error"
