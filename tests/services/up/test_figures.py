"""What `zv up` shows of a node."""

from common.messages import Diagnostics, Latency
from services.up.display import line_of
from services.up.figures import Meter, drops, row_of
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


def test_drops_stand_largest_first_and_what_nobody_wanted_last():
    counters = {
        "received": 9,
        "dropped.stale": 2,
        "dropped.corrupt": 5,
        "dropped.empty": 0,
        "dropped.no_subscriber": 90,
        "missed": 3,
    }
    assert drops(counters) == "corrupt=5 missed=3 stale=2 no_subscriber=90"


def test_a_node_that_does_not_run_shows_no_figures_of_its_earlier_life():
    child = Child("tracker_front", [], restart=True, say=lambda _: None)
    row = row_of(child, health(), Meter())
    assert (row.state, row.rate, row.dropped) == ("starting", "", "")


def test_a_line_has_the_units_and_says_when_nothing_was_dropped(monkeypatch):
    child = Child("tracker_front", [], restart=True, say=lambda _: None)
    child.state = "running"
    monkeypatch.setattr(Child, "alive", True)
    row = row_of(child, health(counters={"received": 0}), Meter())
    assert line_of(row) == "tracker_front    running  rate 30.0 Hz  p50 7.0 ms  dropped none"


def test_a_node_that_complains_shows_its_level_and_words(monkeypatch):
    child = Child("tracker_front", [], restart=True, say=lambda _: None)
    monkeypatch.setattr(Child, "alive", True)
    row = row_of(child, health(level=3, message="no frame for 4 s"), Meter())
    assert (row.state, row.message) == ("stale", "no frame for 4 s")


def test_a_signal_and_a_status_are_told_apart():
    assert ended_how(-9) == "died (signal 9)"
    assert ended_how(3) == "ended with status 3"
