"""Rate bounds: what is warned of, what is not, and that nothing flaps. Times are arguments."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from zenoh_vision.health.rate_monitor import RateMonitor, Shortfall


class Played:
    """A node whose counters rise at given rates, read every second from time 0 on."""

    def __init__(self, arrived: str = "received", expected_hz: float | None = None) -> None:
        self.bounds = RateMonitor(arrived)
        self.bounds.expect(expected_hz)
        self.warned: list[list[str]] = []
        self._arrived = arrived
        self._totals = [0.0, 0.0]

    @property
    def changes(self) -> list[int]:
        """The seconds in which a warning came or went."""
        on = [bool(words) for words in self.warned]
        return [s for s in range(1, len(on)) if on[s] != on[s - 1]]

    def run(
        self,
        seconds: int,
        arrived_hz: float,
        used_hz: float | None = None,
        reason: str = "overwritten",
    ) -> None:
        """Let time pass; without ``used_hz`` everything is used, else the rest is dropped."""
        for _ in range(seconds):
            counters = {
                self._arrived: int(self._totals[0] + 1e-6),
                f"dropped.{reason}": int(self._totals[1] + 1e-6),
            }
            self.warned.append(self.bounds.judge(float(len(self.warned)), counters))
            self._totals[0] += arrived_hz
            self._totals[1] += 0 if used_hz is None else arrived_hz - used_hz


def camera(expected_hz: float | None) -> Played:
    return Played("captured", expected_hz)


# A camera and its configured rate


def test_a_camera_under_its_rate_is_warned_of_with_both_rates():
    played = camera(30.0)
    played.run(20, 20.0)
    assert played.warned[-1] == ["20.0 Hz captured, under the 30 Hz configured"]


def test_a_warning_needs_a_shortfall_of_twice_the_window():
    # The window of 3 s is full at 3 s; from there it takes 6 s.
    played = camera(30.0)
    played.run(20, 20.0)
    assert played.changes == [9]


@pytest.mark.parametrize(
    ("rate_hz", "warned"),
    [
        pytest.param(26.0, True, id="87 %"),
        pytest.param(28.0, False, id="93 %"),
        pytest.param(30.0, False, id="100 %"),
        pytest.param(40.0, False, id="more than configured"),
        pytest.param(0.0, True, id="nothing"),
    ],
)
def test_the_limit_is_ninety_percent(rate_hz: float, warned: bool):
    played = camera(30.0)
    played.run(20, rate_hz)
    assert bool(played.warned[-1]) is warned


def test_a_gap_of_a_second_is_not_warned_of():
    played = camera(30.0)
    for _ in range(4):
        played.run(10, 30.0)
        played.run(1, 0.0)
    assert played.changes == []


def test_a_rate_about_the_limit_warns_once():
    # 88 % and 94 % by turns, 12 s each: both sides of 90 %, never over 95 %.
    played = camera(100.0)
    for _ in range(10):
        played.run(12, 88.0)
        played.run(12, 94.0)
    assert len(played.changes) == 1


def test_a_warning_ends_when_the_rate_has_been_good_for_a_window():
    played = camera(30.0)
    played.run(20, 20.0)
    played.run(20, 30.0)
    # Over 95 % again at 23 s, when the 3 s before it are all good; 3 s later it ends.
    assert played.changes == [9, 26]


@pytest.mark.parametrize("expected_hz", [0.1, 0.5, 1.0, 7.0, 1000.0])
def test_a_camera_at_its_rate_is_never_warned_of_at_any_rate(expected_hz: float):
    played = camera(expected_hz)
    played.run(1000, expected_hz)
    assert played.changes == []


def test_a_slow_camera_at_half_its_rate_is_warned_of():
    # 20 frames of 1 Hz are 20 s; full at 20 s, and 40 s later it counts.
    played = camera(1.0)
    played.run(100, 0.5)
    assert played.changes == [60]
    assert played.warned[-1] == ["0.5 Hz captured, under the 1 Hz configured"]


@pytest.mark.parametrize("expected_hz", [None, 0.05], ids=["no rate known", "too slow to judge"])
def test_without_an_expected_rate_there_is_no_warning(expected_hz: float | None):
    played = camera(expected_hz)
    played.run(300, 0.0)
    assert played.changes == []


def test_a_new_configured_rate_is_judged_from_then_on():
    played = camera(30.0)
    played.run(20, 20.0)
    played.bounds.expect(20.0)
    played.run(20, 20.0)
    assert played.changes == [9, 20]
    played.bounds.expect(40.0)
    played.run(20, 20.0)
    assert played.warned[-1] == ["20.0 Hz captured, under the 40 Hz configured"]


def test_what_was_before_a_restart_does_not_count():
    played = camera(30.0)
    played.run(8, 30.0)
    played.run(15, 0.0)  # the source is gone; the node restarts its bounds while that lasts
    played.bounds.restart()
    played.run(2, 30.0)
    assert played.warned[-1] == []


def test_while_a_warning_lasts_a_rate_that_is_good_again_is_not_called_too_low():
    played = camera(30.0)
    played.run(20, 20.0)
    played.run(5, 30.0)
    # At 24 s the 3 s before have all their frames; the warning ends at 26 s.
    assert played.warned[-1] == ["30.0 Hz captured, was under the 30 Hz configured"]
    assert played.warned[-4] == ["23.3 Hz captured, under the 30 Hz configured"]


def test_while_a_warning_lasts_a_consumer_that_keeps_up_again_is_not_called_slow():
    played = Played()
    played.run(20, 30.0, used_hz=12.0)
    played.run(5, 30.0)
    assert played.warned[-1] == ["was slower than its stream: 30.0 Hz received, 30.0 Hz used"]


# A consumer and its stream


def test_a_consumer_slower_than_its_stream_is_warned_of_with_both_rates():
    played = Played()
    played.run(20, 30.0, used_hz=12.0)
    assert played.warned[-1] == ["slower than its stream: 30.0 Hz received, 12.0 Hz used"]
    assert played.changes == [9]


def test_a_consumer_whose_queue_overflows_is_slower_than_its_stream_too():
    played = Played()
    played.run(20, 30.0, used_hz=12.0, reason="overflow")
    assert played.warned[-1] == ["slower than its stream: 30.0 Hz received, 12.0 Hz used"]


@pytest.mark.parametrize(("used_hz", "warned"), [(26.0, True), (28.0, False)])
def test_a_few_overwritten_frames_are_no_reason(used_hz: float, warned: bool):
    played = Played()
    played.run(20, 30.0, used_hz=used_hz)
    assert bool(played.warned[-1]) is warned


def test_a_consumer_that_keeps_up_again_is_no_longer_warned_of():
    played = Played()
    played.run(20, 30.0, used_hz=12.0)
    played.run(20, 30.0)
    assert played.changes == [9, 26]


def test_a_slow_stream_and_a_slower_consumer():
    # 2 Hz: 20 frames in 10 s, twice that after the first 10 s.
    played = Played()
    played.run(60, 2.0, used_hz=1.0)
    assert played.changes == [30]
    assert played.warned[-1] == ["slower than its stream: 2 Hz received, 1 Hz used"]


def test_a_consumer_is_not_slow_once_nothing_has_arrived_for_3_s():
    played = Played()
    played.run(20, 30.0, used_hz=12.0)
    played.run(60, 0.0)  # the last of 600 frames is in the reading at 20 s
    assert played.changes == [9, 23]


def test_a_consumer_that_drops_half_of_each_burst_is_slow():
    played = Played()
    for _ in range(12):
        played.run(1, 20.0, used_hz=10.0)
        played.run(4, 0.0)
    assert sum(map(bool, played.warned[30:])) >= 15  # in the 3 s after each burst


def test_a_camera_slower_than_its_source_is_told_apart_from_a_slow_source():
    played = camera(30.0)
    played.run(20, 30.0, used_hz=20.0)
    assert played.warned[-1] == ["slower than its stream: 30.0 Hz captured, 20.0 Hz used"]


# Hysteresis


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        pytest.param(lambda s: 0.0, [6], id="for good"),
        pytest.param(lambda s: 1.0, [], id="never"),
        pytest.param(lambda s: 0.0 if s < 6 else 1.0, [], id="for less than 6 s"),
        pytest.param(lambda s: 0.0 if s < 7 else 1.0, [6, 10], id="until 7 s: 3 s later over"),
        pytest.param(lambda s: 0.0 if s % 5 else 1.0, [], id="with a good one every 5 s"),
        pytest.param(lambda s: 0.0 if s < 50 else None, [6, 50], id="until nothing is known"),
    ],
)
def test_a_shortfall_comes_and_goes(ratio: Callable[[int], float | None], expected: list[int]):
    shortfall = Shortfall()
    present = [shortfall.judge(float(s), ratio(s), 3.0) for s in range(100)]
    assert [s for s in range(100) if present[s] != (present[s - 1] if s else False)] == expected


def test_readings_do_not_pile_up():
    played = camera(30.0)
    played.run(1000, 30.0)
    assert len(played.bounds._readings) < 210
