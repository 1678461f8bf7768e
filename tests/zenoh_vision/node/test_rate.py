"""``node.rate``: a loop at a rate that ends when the node stops."""

from __future__ import annotations

import math

import pytest

from tests.support.library import LampSettings
from zenoh_vision.node import rate
from zenoh_vision.node.node import Node


class Clock:
    """Time that passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, wait_s: float) -> None:
        self.now_s += wait_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(rate, "time", clock)
    return clock


def test_it_yields_so_many_times_a_second_however_long_the_work_takes(clock: Clock):
    node = Node("worker")
    times = []
    for number in node.rate(4):
        times.append((number, clock.now_s - 100))
        clock.now_s += 0.125
        if number == 4:
            break
    assert times == [(n, n / 4) for n in range(5)]


def test_what_took_too_long_is_not_made_up_for(clock: Clock):
    node = Node("worker")
    times = []
    for number in node.rate(2):
        times.append(clock.now_s - 100)
        clock.now_s += 2.0 if number == 0 else 0.0
        if number == 3:
            break
    assert times == [0.0, 2.0, 2.5, 3.0]


def test_it_ends_when_the_node_is_told_to_stop_while_it_waits(clock: Clock, monkeypatch):
    node = Node("worker")
    monkeypatch.setattr(clock, "sleep", lambda _: node.stop())
    assert list(node.rate(0.001)) == [0]


def test_the_newest_parameters_are_active_in_each_turn(clock: Clock):
    node = Node("worker", parameters=LampSettings())
    assert node.parameters is not None
    found = []
    for number in node.rate(10):
        found.append(node.parameters.active.settings.power)
        node.parameters.change({"power": number})
        if number == 2:
            break
    assert found == [50, 0, 1]


@pytest.mark.parametrize("rate_hz", [0, -1, math.nan, math.inf])
def test_a_rate_is_above_0_and_finite(rate_hz: float):
    with pytest.raises(ValueError, match="must be above 0 and finite"):
        next(Node("worker").rate(rate_hz))
