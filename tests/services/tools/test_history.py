"""What the counters of nodes did while they were watched."""

import pytest

from services.tools.history import History
from tests.services.tools.presences import presence, report


def at(uptime_s: float, received: int, session: str = "a1"):
    counters = {"received": received, "processed": received, "pending": 0}
    return presence(session=session, health=report(uptime_s=uptime_s, counters=counters))


def test_a_change_is_over_the_time_kept():
    history = History(horizon_s=5.0)
    for second in range(20):
        history.note([at(second, 30 * second)])
    change = history.change(at(19, 0))
    assert change is not None
    assert (change.span_s, change.arrived) == (5.0, 150)


def test_one_report_is_no_change_and_the_same_again_is_none_either():
    history = History(5.0)
    for _ in range(3):
        history.note([at(1, 30)])
    assert history.change(at(1, 30)) is None


def test_two_nodes_of_one_name_have_a_history_each():
    history = History(5.0)
    for second in range(3):
        history.note([at(second, 30 * second, "a1"), at(second, 7 * second, "b2")])
    changes = [history.change(at(0, 0, session)) for session in ("a1", "b2")]
    assert [change and change.arrived for change in changes] == [60, 14]


def test_what_is_there_no_more_is_forgotten():
    history = History(5.0)
    history.note([at(1, 30)])
    history.note([])
    history.note([at(2, 60)])
    assert history.change(at(2, 60)) is None


@pytest.mark.parametrize("later", [29, 0])
def test_counters_that_went_back_say_nothing(later):
    history = History(5.0)
    history.note([at(1, 30)])
    history.note([at(2, later)])
    assert history.change(at(2, later)) is None
