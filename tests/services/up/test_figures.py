"""What `zv up` shows of a node."""

import time

from common.messages import Diagnostics, Latency
from services.figures.board import Report
from services.figures.display import line_of
from services.figures.meter import Meter
from services.up.figures import row_of
from services.up.processes import Child, ended_how


def health(**fields: object) -> Diagnostics:
    return Diagnostics.model_validate(
        {
            "node": "tracker_front",
            "stamp_ns": 1,
            "level": 0,
            "message": "ok",
            "uptime_s": 1.0,
            "counters": {"received": 5, "processed": 4, "dropped.stale": 1, "pending": 0},
            "rate_hz": 29.97,
            "latency_ms": Latency(p50=7.04, p99=None),
            **fields,
        }
    )


def report(silent_s: float = 0.0, **fields: object) -> Report:
    return Report(health(**fields), time.monotonic() - silent_s)


def test_a_node_that_does_not_run_shows_no_figures_of_its_earlier_life():
    child = Child("tracker_front", [], say=lambda _: None)
    row = row_of(child, report(), Meter())
    assert (row.state, row.rate, row.dropped) == ("starting", "", "")


def test_a_line_has_the_units_and_says_when_nothing_was_dropped(monkeypatch):
    child = Child("tracker_front", [], say=lambda _: None)
    child.state = "running"
    monkeypatch.setattr(Child, "alive", True)
    row = row_of(child, report(counters={"received": 0}), Meter())
    assert line_of(row) == "tracker_front    running  rate 30.0 Hz  p50 7.0 ms  dropped none"


def test_a_node_that_complains_shows_its_level_and_words(monkeypatch):
    child = Child("tracker_front", [], say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    row = row_of(child, report(level=3, message="no frame for 4 s"), Meter())
    assert (row.state, row.message) == ("stale", "no frame for 4 s")


def test_a_node_that_says_nothing_shows_that_and_no_figures_of_the_past(monkeypatch):
    child = Child("tracker_front", [], say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    row = row_of(child, report(silent_s=4.2), Meter())
    assert (row.state, row.rate, row.dropped) == ("silent for 4 s", "", "")


def test_what_nobody_wanted_stands_last_in_a_line_too(monkeypatch):
    child = Child("camera_front", [], say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    counters = {"captured": 9, "dropped.no_subscriber": 7, "dropped.overwritten": 2}
    line = line_of(row_of(child, report(counters=counters), Meter()))
    assert line.endswith("dropped overwritten=2 no_subscriber=7")


def test_a_signal_and_a_status_are_told_apart():
    assert ended_how(-9) == "died (signal 9)"
    assert ended_how(3) == "ended with status 3 (cannot open its source)"
    assert ended_how(1) == "ended with status 1"
