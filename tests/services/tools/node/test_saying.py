"""What is known of a node that was found, without a network."""

import pytest

from services.tools.facts import duration, facts
from services.tools.node.info import lines, spelled
from services.tools.node.watching import Attendance
from services.tools.nodes import Presence
from tests.services.tools.presences import NOW_NS, S, presence, report


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
    found = presence(health=report(stamp_ns=NOW_NS - 4 * S))
    assert (found.uptime_s, found.silent_s) == (60.0, 4.0)


def test_of_a_node_that_does_not_answer_there_is_its_name():
    about = facts(Presence("tracker_front"))
    assert (about["node"], about["answers"]) == ("tracker_front", False)
    assert {value for name, value in about.items() if name not in ("node", "answers")} == {None}
    assert list(lines(Presence("tracker_front"), [])) == [
        "tracker_front",
        "  health      shows its token but does not answer",
    ]


def test_the_lines_about_a_node_name_everything():
    found = presence(publishes=("a/b", "c/d"), health=report(level=1, message="slow"))
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
    from common.messages import Parameter

    said = Parameter(node="n", name="p", type="x", default=None, **fields)
    assert spelled(said) == words


def test_who_comes_and_who_goes_is_told_once():
    attendance = Attendance()
    front, left = presence(), presence("tracker_left", "b2")
    assert attendance.update([front]) == ([front], [])
    assert attendance.update([front, left]) == ([left], [])
    assert attendance.update([left]) == ([], [front])
    assert attendance.update([left]) == ([], [])


def test_a_node_that_does_not_answer_once_has_not_gone():
    attendance = Attendance()
    attendance.update([presence()])
    assert attendance.update([Presence("tracker_front")]) == ([], [])
    assert attendance.update([presence()]) == ([], [])


def test_a_second_node_of_a_name_comes_and_goes_by_itself():
    attendance = Attendance()
    first, second = presence(session="a1"), presence(session="b2")
    attendance.update([first])
    assert attendance.update([first, second]) == ([second], [])
    assert attendance.update([second]) == ([], [first])
