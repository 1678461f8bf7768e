"""Rate bounds: what is warned of, what is not, and that nothing flaps. Times are arguments."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from zenoh_vision.health.rate_monitor import RateMonitor, Shortfall

Phase = tuple[int, float] | tuple[int, float, float]
"""Seconds, how many items a second arrive, and how many of these are used; by default all."""


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

    def run(self, *phases: Phase, reason: str = "overwritten") -> list[str]:
        """Let time pass, and return what is warned of then; what is not used is dropped."""
        for seconds, arrived_hz, *used_hz in phases:
            for _ in range(seconds):
                counters = {
                    self._arrived: int(self._totals[0] + 1e-6),
                    f"dropped.{reason}": int(self._totals[1] + 1e-6),
                }
                self.warned.append(self.bounds.judge(float(len(self.warned)), counters))
                self._totals[0] += arrived_hz
                self._totals[1] += arrived_hz - used_hz[0] if used_hz else 0
        return self.warned[-1]


UNDER = "20.0 Hz captured, under the 30 Hz configured"
SLOW = "slower than its stream: 30.0 Hz received, 12.0 Hz used"

CAMERAS: dict[str, tuple[float | None, list[Phase], list[int], str]] = {
    # The window of 3 s is full at 3 s; from there a shortfall needs twice the window, 6 s.
    "under its rate": (30, [(20, 20)], [9], UNDER),
    "with a gap of a second": (30, [(10, 30), (1, 0)] * 4, [], ""),
    # 88 % and 94 % by turns, 12 s each: both sides of 90 %, never over 95 %.
    "about the limit": (100, [(12, 88), (12, 94)] * 9 + [(12, 88)], [9], "8"),
    # Over 95 % again at 23 s, when the 3 s before it are all good; 3 s later it ends.
    "good again for a window": (30, [(20, 20), (20, 30)], [9, 26], ""),
    # At 24 s the 3 s before have all their frames, and the warning ends at 26 s.
    "good again, while the warning lasts": (
        30,
        [(20, 20), (5, 30)],
        [9],
        "30.0 Hz captured, was under the 30 Hz configured",
    ),
    "getting better": (
        30,
        [(20, 20), (2, 30)],
        [9],
        "23.3 Hz captured, under the 30 Hz configured",
    ),
    # 20 frames of 1 Hz are 20 s; full at 20 s, and 40 s later it counts.
    "at half of a slow rate": (
        1,
        [(100, 0.5)],
        [60],
        "0.5 Hz captured, under the 1 Hz configured",
    ),
    "without a known rate": (None, [(300, 0)], [], ""),
    "too slow to judge": (0.05, [(300, 0)], [], ""),
    # It is the camera that is slow, not the source.
    "slower than its source": (
        30,
        [(20, 30, 20)],
        [9],
        "slower than its stream: 30.0 Hz captured, 20.0 Hz used",
    ),
    **{f"at its rate of {rate} Hz": (rate, [(1000, rate)], [], "") for rate in (0.1, 0.5, 7, 1000)},
}


@pytest.mark.parametrize(
    ("expected_hz", "phases", "changes", "warned"), CAMERAS.values(), ids=CAMERAS
)
def test_a_camera_is_warned_of(
    expected_hz: float | None, phases: list[Phase], changes: list[int], warned: str
):
    played = Played("captured", expected_hz)
    found = played.run(*phases)
    assert played.changes == changes
    assert [words[: len(warned)] for words in found] == ([warned] if warned else [])


CONSUMERS: dict[str, tuple[list[Phase], list[int], str]] = {
    "slower than its stream": ([(20, 30, 12)], [9], SLOW),
    "that keeps up again": ([(20, 30, 12), (20, 30)], [9, 26], ""),
    "that keeps up again, while the warning lasts": (
        [(20, 30, 12), (5, 30)],
        [9],
        "was slower than its stream: 30.0 Hz received, 30.0 Hz used",
    ),
    # 2 Hz: 20 frames in 10 s, twice that after the first 10 s.
    "slower than a slow stream": (
        [(60, 2, 1)],
        [30],
        "slower than its stream: 2 Hz received, 1 Hz used",
    ),
    # The last of 600 frames is in the reading at 20 s.
    "to which nothing has come for 3 s": ([(20, 30, 12), (60, 0)], [9, 23], ""),
    "that drops 13 %": ([(20, 30, 26)], [9], "slower"),
    "that drops 7 %": ([(20, 30, 28)], [], ""),
}


@pytest.mark.parametrize(("phases", "changes", "warned"), CONSUMERS.values(), ids=CONSUMERS)
def test_a_consumer_is_warned_of(phases: list[Phase], changes: list[int], warned: str):
    played = Played()
    found = played.run(*phases)
    assert played.changes == changes
    assert [words[: len(warned)] for words in found] == ([warned] if warned else [])


def test_a_consumer_whose_queue_overflows_is_slower_than_its_stream_too():
    assert Played().run((20, 30, 12), reason="overflow") == [SLOW]


@pytest.mark.parametrize(
    ("rate_hz", "warned"),
    [
        pytest.param(26.0, True, id="87 %"),
        pytest.param(28.0, False, id="93 %"),
        pytest.param(40.0, False, id="more than configured"),
        pytest.param(0.0, True, id="nothing"),
    ],
)
def test_the_limit_is_ninety_percent(rate_hz: float, warned: bool):
    assert bool(Played("captured", 30).run((20, rate_hz))) is warned


def test_a_new_configured_rate_is_judged_from_then_on():
    played = Played("captured", 30)
    played.run((20, 20))
    played.bounds.expect(20.0)
    played.run((20, 20))
    assert played.changes == [9, 20]
    played.bounds.expect(40.0)
    assert played.run((20, 20)) == ["20.0 Hz captured, under the 40 Hz configured"]


def test_what_was_before_a_restart_does_not_count():
    played = Played("captured", 30)
    played.run((8, 30), (15, 0))  # the source is gone; the node restarts its bounds meanwhile
    played.bounds.restart()
    assert played.run((2, 30)) == []


def test_a_consumer_that_drops_half_of_each_burst_is_slow():
    played = Played()
    played.run(*[(1, 20, 10), (4, 0)] * 12)
    assert sum(map(bool, played.warned[30:])) >= 15  # in the 3 s after each burst


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
    played = Played("captured", 30)
    played.run((1000, 30))
    assert len(played.bounds._readings) < 210
