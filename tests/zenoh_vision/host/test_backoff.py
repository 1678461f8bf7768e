"""The delays between attempts."""

from __future__ import annotations

from zenoh_vision.host.backoff import Backoff


def delays(backoff: Backoff, count: int) -> list[float]:
    return [backoff.next_delay_s() for _ in range(count)]


def test_the_delay_doubles_up_to_the_longest_until_a_success():
    backoff = Backoff(1.0, 5.0)
    assert delays(backoff, 5) == [1.0, 2.0, 4.0, 5.0, 5.0]
    backoff.reset()
    assert delays(backoff, 2) == [1.0, 2.0]


def test_the_first_delay_is_kept_though_it_is_above_the_longest():
    assert delays(Backoff(10.0, 5.0), 3) == [10.0, 5.0, 5.0]


def test_limits_that_change_hold_from_the_next_delay_on():
    backoff = Backoff(1.0, 100.0)
    assert delays(backoff, 4) == [1.0, 2.0, 4.0, 8.0]
    backoff.first_s, backoff.longest_s = 0.25, 6.0
    assert delays(backoff, 2) == [6.0, 6.0]
    backoff.reset()
    assert delays(backoff, 2) == [0.25, 0.5]
