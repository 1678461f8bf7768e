"""When the moments of a recording are due."""

from __future__ import annotations

import pytest

from tests.support.clocks import SteppedClock
from zv.bag.replay_clock import ReplayClock

S = 10**9
BEGIN = 1_700_000_000 * S


def test_moments_are_due_at_their_distance_from_the_begin():
    clock = SteppedClock()
    time = ReplayClock(clock, BEGIN)
    assert time.wait_s(BEGIN + 2 * S) == 2.0
    clock.step(1.5)
    assert time.wait_s(BEGIN + 2 * S) == 0.5
    assert time.position_ns == BEGIN + 3 * S // 2


@pytest.mark.parametrize(("speed", "expected_s"), [(0.5, 4.0), (4.0, 0.5), (0.0, 0.0)])
def test_speed_divides_the_wait(speed: float, expected_s: float):
    assert ReplayClock(SteppedClock(), BEGIN, speed).wait_s(BEGIN + 2 * S) == expected_s


def test_a_change_of_speed_holds_from_the_moment_of_the_change():
    clock = SteppedClock()
    time = ReplayClock(clock, BEGIN)
    clock.step(1.0)
    time.set(2.0, paused=False)
    clock.step(1.0)
    assert time.position_ns == BEGIN + 3 * S


def test_nothing_is_due_while_paused_and_the_pause_is_no_delay():
    clock = SteppedClock()
    time = ReplayClock(clock, BEGIN)
    clock.step(1.0)
    time.set(1.0, paused=True)
    clock.step(100.0)
    assert time.wait_s(BEGIN + 2 * S) is None
    time.set(1.0, paused=False)
    assert time.wait_s(BEGIN + 2 * S) == 1.0


def test_after_a_suspension_it_goes_on_from_where_it_was():
    clock = SteppedClock()
    time = ReplayClock(clock, BEGIN)
    clock.step(60.0)  # the machine slept
    assert time.wait_s(BEGIN + 1 * S) == 0.0
    assert time.wait_s(BEGIN + 2 * S) == 1.0  # and not a burst of a minute


def test_a_moment_has_its_time_of_day():
    clock = SteppedClock()
    time = ReplayClock(clock, BEGIN, 2.0)
    assert time.wall_ns(BEGIN + 4 * S) == clock.wall_ns + 2 * S
