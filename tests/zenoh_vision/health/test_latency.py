"""Rate, latency and complaints; all times are arguments."""

from __future__ import annotations

import logging

import pytest

from zenoh_vision.errors import PayloadError
from zenoh_vision.health.latency import BOUNDS_MS, LatencyMonitor
from zenoh_vision.health.log_throttle import QUIET_S, LogThrottle
from zenoh_vision.messages import Latency

LOG = logging.getLogger("tracker_front")


def pace_of(*latencies: float, step_s: float = 0.0) -> LatencyMonitor:
    pace = LatencyMonitor()
    for n, latency in enumerate(latencies):
        pace.note(n * step_s, latency)
    return pace


@pytest.mark.parametrize(
    ("latencies", "p50", "p99"),
    [
        # Nearest rank: the value at place ceil(p / 100 * n) of n in order, counted from 1.
        pytest.param([7.0], 7.0, 7.0, id="one: places 1 and 1"),
        pytest.param([2.0, 1.0], 1.0, 2.0, id="two: ceil(1.0) = 1, ceil(1.98) = 2"),
        pytest.param([3.0, 1.0, 2.0], 2.0, 3.0, id="three: ceil(1.5) = 2, ceil(2.97) = 3"),
        pytest.param([4.0, 1.0, 3.0, 2.0], 2.0, 4.0, id="four: 2 and ceil(3.96) = 4"),
        pytest.param(list(map(float, range(1, 101))), 50.0, 99.0, id="hundred: 50 and 99"),
        pytest.param(list(map(float, range(200, 0, -1))), 100.0, 198.0, id="200: 100 and 198"),
    ],
)
def test_percentiles(latencies: list[float], p50: float, p99: float):
    assert pace_of(*latencies).percentiles(0.0) == Latency(p50=p50, p99=p99)


def test_latency_is_nil_before_the_first_frame_and_after_the_last_left_the_window():
    pace = LatencyMonitor(window_s=5.0)
    assert pace.percentiles(0.0) == Latency(p50=None, p99=None)
    pace.note(0.0, 1000.0)
    pace.note(10.0, 3.0)
    assert pace.percentiles(15.0) == Latency(p50=3.0, p99=3.0)
    assert pace.percentiles(15.01) == Latency(p50=None, p99=None)


@pytest.mark.parametrize("count", [0, 1])
def test_a_rate_needs_two_frames(count: int):
    assert pace_of(*[1.0] * count).rate_hz(1.0) == 0.0


def test_a_rate_needs_a_second_since_the_first_frame_is_slow():
    # Due each 0.1 s; the first one was done 70 ms late.
    pace = LatencyMonitor()
    for at_s in (0.07, *(n * 0.1 for n in range(1, 12))):
        pace.note(at_s, 1.0)
    assert pace.rate_hz(1.06) == 0.0
    # 11 intervals in 1.03 s; after the first alone it would be 1 / 0.03 s = 33 Hz.
    assert pace.rate_hz(1.1) == pytest.approx(11 / 1.03)


@pytest.mark.parametrize(
    ("frames", "at_s", "rate_hz", "within"),
    [
        pytest.param(31, 3.0, 10.0, 1e-6, id="30 intervals of 0.1 s in 3 s"),
        pytest.param(31, 3.05, 10.0, 1e-6, id="half a period later, when nothing is overdue"),
        pytest.param(200, 19.9, 10.0, 0.21, id="a full window, from 14.9 s: 50 intervals in 5 s"),
        pytest.param(31, 6.0, 4.0, 0.21, id="none since 3 s: 20 intervals from 1 s on, in 5 s"),
        pytest.param(31, 9.0, 0.0, 1e-6, id="none in the window"),
    ],
)
def test_the_rate_is_intervals_over_time(frames: int, at_s: float, rate_hz: float, within: float):
    assert pace_of(*[1.0] * frames, step_s=0.1).rate_hz(at_s) == pytest.approx(rate_hz, abs=within)


def test_what_has_no_stamp_counts_for_the_rate_and_for_no_latency():
    # 31 items at 0.1 s, of which the first alone has a latency.
    pace = LatencyMonitor()
    for n in range(31):
        pace.note(n * 0.1, None if n else 7.0)
    assert pace.rate_hz(3.0) == pytest.approx(10.0)
    assert pace.percentiles(3.0) == Latency(p50=7.0, p99=7.0)
    assert (pace.histogram().counts[-1], pace.histogram().sum) == (1, 7.0)
    assert pace.percentiles(5.05) == Latency(p50=None, p99=None)


def histogram_of(*latencies: float) -> dict[float, int]:
    """Return how many frames were counted up to each bound; infinity for all."""
    found = pace_of(*latencies).histogram()
    return dict(zip((*found.bounds, float("inf")), found.counts, strict=True))


def test_a_histogram_counts_each_frame_up_to_every_bound_that_is_not_less():
    # 2.0 is at most 2, 2.5 is at most 3, 6000 is over every bound.
    counted = histogram_of(2.0, 2.5, 6000.0)
    bounds = (1.0, 2.0, 3.0, 5000.0, float("inf"))
    assert [counted[bound] for bound in bounds] == [0, 1, 2, 2, 3]
    assert pace_of(2.0, 2.5, 6000.0).histogram().sum == 6004.5


def test_a_histogram_before_the_first_frame_is_all_zeros():
    assert set(histogram_of().values()) == {0}
    assert LatencyMonitor().histogram().sum == 0.0


def test_a_histogram_keeps_what_has_left_the_window():
    pace = LatencyMonitor(window_s=5.0)
    for at_s in (0.0, 100.0):
        pace.note(at_s, 4.0)
    assert pace.percentiles(200.0) == Latency(p50=None, p99=None)
    assert pace.histogram().counts[-1] == 2


def test_a_latency_below_zero_never_makes_the_sum_fall():
    assert histogram_of(4.0, -20.0)[BOUNDS_MS[0]] == 1
    assert pace_of(4.0, -20.0).histogram().sum == 4.0
    assert pace_of(4.0, -20.0).percentiles(0.0).p50 == -20.0  # what is shown still says so


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    found = [record.getMessage() for record in caplog.records]
    caplog.clear()
    return found


def test_a_burst_is_logged_once_and_summed_up_when_it_is_over(caplog: pytest.LogCaptureFixture):
    complaints = LogThrottle(LOG)
    for n in range(100):
        complaints.note(PayloadError("corrupt", f"frame {n}"), n * 0.1)  # the last at 9.9 s
        complaints.flush(n * 0.1)
    assert warnings(caplog) == ["dropped a sample, corrupt: frame 0"]
    complaints.flush(9.9 + QUIET_S)
    assert warnings(caplog) == []
    complaints.flush(9.9 + QUIET_S + 0.1)
    assert warnings(caplog) == ["dropped 99 more samples as corrupt"]
    complaints.flush(100.0)
    assert warnings(caplog) == []


def test_the_next_burst_is_logged_again(caplog: pytest.LogCaptureFixture):
    complaints = LogThrottle(LOG)
    complaints.note(PayloadError("corrupt", "first"), 0.0)
    complaints.flush(QUIET_S + 0.1)
    complaints.note(PayloadError("corrupt", "second"), QUIET_S + 0.2)
    assert warnings(caplog) == [
        "dropped a sample, corrupt: first",  # and nothing to sum up: it was one
        "dropped a sample, corrupt: second",
    ]


def test_each_reason_is_a_burst_of_its_own(caplog: pytest.LogCaptureFixture):
    complaints = LogThrottle(LOG)
    assert complaints.current() == []
    complaints.note(PayloadError("stale", "late"), 0.0)
    complaints.note(PayloadError("corrupt", "bad"), 4.0)
    assert len(warnings(caplog)) == 2
    assert complaints.current() == ["corrupt", "stale"]
    complaints.flush(QUIET_S + 1.0)
    assert complaints.current() == ["corrupt"]


def test_complaints_are_warnings_of_the_node(caplog: pytest.LogCaptureFixture):
    LogThrottle(LOG).note(PayloadError("empty", "no bytes"), 0.0)
    (record,) = caplog.records
    assert (record.levelno, record.name) == (logging.WARNING, "tracker_front")
