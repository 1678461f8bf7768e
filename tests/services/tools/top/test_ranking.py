"""zv top shows those that hurt first: by level, then by losses, then by latency."""

import os
import socket

import psutil
import pytest

from common.messages import Latency
from services.figures.change import Change
from services.tools.nodes import Presence
from services.tools.top.ranking import Figures, Observer, record_of, rows_of
from tests.services.tools.presences import NOW_NS, S, presence, report


def lost(share: float) -> Change:
    return Change(span_s=5.0, arrived=1000, done=0, losses={"stale": int(1000 * share)})


def node(name: str, change: Change | None = None, **health: object) -> Figures:
    return Figures(presence(name, health=report(**health)), change)


ORDER = [
    Figures(Presence("does_not_answer")),
    node("error", level=2),
    node("stale_and_losing", lost(0.5), level=3),
    node("stale", level=3),
    node("silent", stamp_ns=NOW_NS - 4 * S),
    node("warns", level=1),
    node("loses_much", lost(0.2), latency_ms=Latency(p50=1.0, p99=1.0)),
    node("loses_little", lost(0.01), latency_ms=Latency(p50=80.0, p99=99.0)),
    node("late", latency_ms=Latency(p50=80.0, p99=99.0)),
    node("a_quick_one"),
    node("b_quick_one"),
    node("no_frame_yet", latency_ms=Latency(p50=None, p99=None)),
]


def test_what_hurts_more_stands_first():
    mixed = ORDER[::-1]
    names = [each.presence.name for each in sorted(mixed, key=lambda each: each.pain)]
    expected = [each.presence.name for each in ORDER]
    assert names == [*expected[:3], "silent", "stale", *expected[5:]]  # these two hurt the same


def test_the_state_says_what_is_wrong():
    states = {row.node: row.state for row in rows_of(ORDER)}
    assert states["does_not_answer"] == "no answer"
    assert states["silent"] == "silent for 4 s"
    assert states["error"] == "ERROR"
    assert states["late"] == "running"


def test_losses_are_shown_in_percent_and_hosts_only_if_there_are_several():
    (row,) = rows_of([node("tracker_front", lost(0.123))])
    assert (row.lost, row.host) == ("12.3", "")
    here = Figures(presence("camera_front", host="attic"))
    assert [row.host for row in rows_of([node("tracker_front"), here])] == ["roof", "attic"]


def test_two_nodes_of_one_name_are_told_apart():
    twins = [Figures(presence("camera_front", s, pid=p)) for s, p in (("a", 7), ("b", 8))]
    assert [row.node for row in rows_of(twins)] == ["camera_front (7)", "camera_front (8)"]


def test_what_a_node_says_does_not_steer_the_terminal():
    (row,) = rows_of([node("tracker_front", level=1, message="\x1b[2Jgone")])
    assert row.message == "\\x1b[2Jgone"


def test_a_record_has_numbers_where_the_table_has_text():
    record = record_of(node("tracker_front", lost(0.25)))
    assert (record["lost"], record["losses"]) == (0.25, {"stale": 250})
    assert record["latency_ms"] == {"p50": 5.0, "p99": 9.0}
    assert record["level"] == "OK"


def test_cpu_and_memory_are_those_of_this_machines_processes():
    created_ns = int(psutil.Process().create_time() * 1e9)
    here = presence(
        "camera_front", host=socket.gethostname(), pid=os.getpid(), started_ns=created_ns + S
    )
    there = presence("tracker_front", pid=os.getpid())
    observer = Observer()
    observer.look([here, there])
    figures = {each.presence.name: each for each in observer.look([here, there])}
    assert figures["camera_front"].memory_mb is not None
    assert figures["camera_front"].memory_mb > 1
    assert figures["tracker_front"].memory_mb is None


def test_a_process_that_has_an_id_again_is_not_taken_for_the_node():
    here = presence(host=socket.gethostname(), pid=os.getpid(), started_ns=5 * S)
    observer = Observer()
    observer.look([here])
    assert observer.look([here])[0].memory_mb is None


@pytest.mark.parametrize("order", [ORDER, ORDER[::-1]])
def test_the_observer_sorts(order):
    figures = Observer().look([each.presence for each in order])
    assert figures[0].presence.name == "does_not_answer"
    assert figures[1].presence.name == "error"
