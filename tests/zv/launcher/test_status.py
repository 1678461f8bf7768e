"""What `zv up` shows of a node."""

import io
import re
import time
import unicodedata

import pytest
from rich.console import Console

from tests.support.node_states import report
from zenoh_vision.health.node_state import NodeState, S
from zenoh_vision.messages import Diagnostics, Latency
from zv.launcher.child import Child, ended_how
from zv.launcher.command_line import CommandLine
from zv.launcher.supervisor import child_row
from zv.status.display import Display, LiveTable, View
from zv.status.process_usage import ProcessUsage
from zv.status.row import line_of, row_of, view_of


def health(**fields: object) -> Diagnostics:
    counters = {"received": 5, "processed": 4, "dropped.stale": 1, "pending": 0}
    known = {"counters": counters, "rate_hz": 29.97, "latency_ms": Latency(p50=7.04, p99=None)}
    return report(**known | fields)


def node(silent_s: float = 0.0, **fields: object) -> NodeState:
    arrived_ns = time.monotonic_ns() - int(silent_s * S)
    return NodeState("tracker_front").with_report(health(**fields), arrived_ns, 0.0)


def test_a_node_that_does_not_run_shows_no_figures_of_its_earlier_life():
    child = Child("tracker_front", CommandLine((), {}), say=lambda _: None)
    row = child_row(child, node(), ProcessUsage())
    assert (row.state, row.rate, row.dropped) == ("starting", "", "")


def test_a_line_has_the_units_and_says_when_nothing_was_dropped(monkeypatch):
    child = Child("tracker_front", CommandLine((), {}), say=lambda _: None)
    child.state = "running"
    monkeypatch.setattr(Child, "alive", True)
    row = child_row(child, node(counters={"received": 0}), ProcessUsage())
    assert line_of(row) == "tracker_front    running  rate 30.0 Hz  p50 7.0 ms  dropped none"


def test_a_node_that_complains_shows_its_level_and_words(monkeypatch):
    child = Child("tracker_front", CommandLine((), {}), say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    row = child_row(child, node(level=3, message="no frame for 4 s"), ProcessUsage())
    assert (row.state, row.message) == ("stale", "no frame for 4 s")


def test_a_node_that_says_nothing_shows_that_and_no_figures_of_the_past(monkeypatch):
    child = Child("tracker_front", CommandLine((), {}), say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    row = child_row(child, node(silent_s=4.2), ProcessUsage())
    assert (row.state, row.rate, row.dropped) == ("silent for 4 s", "", "")


def test_what_nobody_wanted_stands_last_in_a_line_too(monkeypatch):
    child = Child("camera_front", CommandLine((), {}), say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    counters = {"captured": 9, "dropped.no_subscriber": 7, "dropped.overwritten": 2}
    line = line_of(child_row(child, node(counters=counters), ProcessUsage()))
    assert line.endswith("dropped overwritten=2 no_subscriber=7")


def test_a_signal_and_a_status_are_told_apart():
    assert ended_how(-9) == "died (signal 9)"
    assert ended_how(3) == "ended with status 3 (cannot open its source)"
    assert ended_how(1) == "ended with status 1"


HOSTILE = "\x1b]0;t\x07\x1b[2J\x9b1m\u202e\r\nrouter  running\x7f"


def steering(text: str) -> set[str]:
    """Return the characters that could steer a terminal, beside line ends."""
    categories = {"Cc", "Cf", "Zl", "Zp"}
    return {each for each in text if unicodedata.category(each) in categories} - {"\n"}


@pytest.fixture
def hostile_view() -> View:
    report = health(message=HOSTILE, counters={f"dropped.{HOSTILE}": 3}, level=2)
    return view_of([row_of("tracker_front", report, host=HOSTILE)], headline=HOSTILE)


def test_a_line_of_a_node_steers_no_terminal(hostile_view: View, capsys):
    display = Display()
    display.show(hostile_view)
    display.say(HOSTILE)
    shown = capsys.readouterr()
    assert len(shown.out.splitlines()) == 2  # the headline and the node
    assert len(shown.err.splitlines()) == 1
    assert steering(shown.out + shown.err) == set()
    assert "\\x1b]0;t" in shown.out


def test_the_table_on_a_terminal_is_steered_by_no_node(hostile_view: View):
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=400, no_color=True)
    console.print(hostile_view.table())
    LiveTable(console).announce(HOSTILE)
    text = re.sub(r"\x1b\[[0-9;]*m", "", file.getvalue())  # rich's own colours
    assert steering(text) == set()
    assert not [line for line in text.splitlines() if line.startswith("router")]
    assert "\\x1b]0;t" in text
