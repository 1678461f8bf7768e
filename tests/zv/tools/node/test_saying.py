"""What is known of a node that was found, without a network."""

import pytest

from tests.support.node_states import NOW_NS, S, node_state, report
from zenoh_vision.health.node_state import NodeState
from zv.tools.node.info import lines, spelled
from zv.tools.shared.nodes import duration, node_facts


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (None, "-"),
        (0.9, "0 s"),
        (59.9, "59 s"),
        (60, "1 min 0 s"),
        (3 * 3600 + 61, "3 h 1 min"),
        (2 * 86400 + 5 * 3600 + 59, "2 d 5 h"),
    ],
)
def test_a_duration_is_said_in_its_two_largest_units(seconds, words):
    assert duration(seconds) == words


def test_uptime_and_silence_are_by_the_nodes_own_clock():
    found = node_state(health=report(stamp_ns=NOW_NS - 4 * S))
    assert (found.uptime_s, found.silent_s) == (60.0, 4.0)


def test_of_a_node_that_does_not_answer_there_is_its_name():
    about = node_facts(NodeState("tracker_front"))
    assert (about["node"], about["answers"]) == ("tracker_front", False)
    assert {value for name, value in about.items() if name not in ("node", "answers")} == {None}
    assert list(lines(NodeState("tracker_front"), [])) == [
        "tracker_front",
        "  health      has a liveliness token but does not answer",
    ]


def test_the_lines_about_a_node_name_everything():
    found = node_state(publishes=("a/b", "c/d"), health=report(level=1, message="slow"))
    assert list(lines(found, [])) == [
        "tracker_front",
        "  service     tracker",
        "  cameras     front",
        "  version     0.1.0",
        "  host        roof, pid 77",
        "  uptime      1 min 0 s",
        "  health      WARN: slow",
        "  rate        30.0 Hz",
        "  latency     5.0 ms, p99 9.0 ms",
        "  counters    received 100",
        "              processed 100",
        "              pending 0",
        "  publishes   a/b",
        "              c/d",
        "  subscribes  -",
    ]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"value": 80, "minimum": 1.0, "maximum": 100.0}, "p = 80 (1 to 100)"),
        ({"value": 0.4, "unit": "s"}, "p = 0.4 s"),
        ({"value": "none", "choices": ("none", "both")}, 'p = "none" (none, both)'),
        (
            {"value": None, "unit": "Hz", "minimum": 0.5, "maximum": 4294967295.0},
            "p = not set (0.5 to 4294967295)",
        ),
        ({"value": True}, "p = true"),
    ],
)
def test_a_parameter_is_spelled_with_its_unit_and_what_it_may_be(fields, words):
    from zenoh_vision.messages import Parameter

    said = Parameter(node="n", name="p", type="x", default=None, **fields)
    assert spelled(said) == words
