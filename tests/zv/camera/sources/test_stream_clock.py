"""When the pictures of a stream were captured; all expected values are derived by hand."""

from __future__ import annotations

import pytest

from zv.camera.sources.stream_clock import DRIFT, StreamClock, stamp_ns


def clock_of(*arrivals: tuple[float, float]) -> StreamClock:
    clock = StreamClock()
    for time_s, arrived_s in arrivals:
        clock.arrive(time_s, arrived_s)
    return clock


def test_before_the_first_packet_nothing_is_known():
    assert StreamClock().captured_s(1.0) is None


def test_the_packet_that_came_fastest_took_no_time():
    # The delays over the fastest, the third, are 0.2, 0.1, 0 and 0.3 s.
    clock = clock_of((0.0, 100.2), (0.1, 100.2), (0.2, 100.2), (0.3, 100.6))
    found = [clock.captured_s(time_s) for time_s in (0.0, 0.1, 0.2, 0.3)]
    assert found == pytest.approx([100.0, 100.1, 100.2, 100.3], abs=1e-3)


def test_what_was_held_back_is_as_old_as_it_is():
    clock = clock_of(*((k / 10, 50 + k / 10) for k in range(20)))
    for k in range(20, 50):  # three seconds come at once
        clock.arrive(k / 10, 55.0)
    assert clock.captured_s(2.0) == pytest.approx(52.0, abs=2e-3)
    assert clock.captured_s(4.9) == pytest.approx(54.9, abs=2e-3)


def test_a_clock_that_runs_slower_is_followed_and_a_lag_is_not_forgotten():
    slower, lagging = StreamClock(), StreamClock()
    for second in range(3600):
        slower.arrive(second * (1 - 100e-6), second)
        lagging.arrive(second, second + (3.0 if second >= 10 else 0.0))
    assert slower.captured_s(3599 * (1 - 100e-6)) == pytest.approx(3599, abs=1e-6)
    assert lagging.captured_s(3599) == pytest.approx(3599 + 3590 * DRIFT, abs=0.01)


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0, -1.5], ids=["forward", "back", "a bit back"])
def test_a_clock_that_is_set_begins_anew(jump_s: float):
    clock = clock_of((0.0, 10.0), (0.1, 10.1), (0.2 + jump_s, 10.25), (0.3 + jump_s, 10.3))
    assert clock.captured_s(0.3 + jump_s) == pytest.approx(10.3, abs=1e-3)


def test_the_delay_that_the_camera_tells_is_believed_if_its_clock_is_right():
    clock = StreamClock()
    clock.arrive(0.0, 10.0)
    clock.arrive(0.1, 10.1, delay_s=0.25)
    assert (clock.is_camera_clock, clock.ahead_s) == (True, None)
    assert clock.captured_s(0.1) == pytest.approx(10.1 - 0.25)
    clock.arrive(0.2, 13.2, delay_s=3.25)  # it was held back for 3 s
    assert clock.captured_s(0.2) == pytest.approx(13.2 - 3.25)
    assert clock.is_camera_clock


@pytest.mark.parametrize(
    "delay_s", [7200.0, 1.5, 0.6, -7200.0], ids=["behind", "1.5 s behind", "a bit behind", "ahead"]
)
def test_a_camera_whose_clock_is_wrong_is_not_believed_but_said(delay_s: float):
    clock = StreamClock()
    clock.arrive(0.0, 10.0, delay_s=delay_s)
    clock.arrive(0.1, 10.2, delay_s=delay_s + 0.1)
    assert not clock.is_camera_clock
    assert clock.ahead_s == pytest.approx(-delay_s)
    assert clock.captured_s(0.1) == pytest.approx(10.1, abs=1e-3)


def test_a_clock_that_is_a_little_ahead_stamps_nothing_in_the_future():
    clock = StreamClock()
    clock.arrive(0.0, 10.0, delay_s=-0.03)
    assert clock.is_camera_clock
    assert clock.captured_s(0.0) == 10.0


def test_a_stamp_is_later_than_the_one_before_unless_the_wall_clock_was_set_back():
    second = 1_000_000_000
    assert stamp_ns(0.25, 100 * second, 0) == 99_750_000_000
    assert stamp_ns(-0.25, 100 * second, 0) == 100 * second
    assert stamp_ns(0.25, 100 * second, 99_900_000_000) == 99_900_000_001
    assert stamp_ns(0.25, 100 * second, 99_750_000_000) == 99_750_000_001
    assert stamp_ns(0.0, 40 * second, 100 * second) == 40 * second
