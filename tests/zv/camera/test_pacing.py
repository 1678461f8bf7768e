"""Pacing without a clock: the test is the clock."""

from __future__ import annotations

import numpy as np
import pytest

from zv.camera import pacing
from zv.camera.pacing import PictureTimer, Schedule

PERIOD_S = 1 / 30


class Clock:
    """The time, which passes by waiting and working alone; it is the timer's wake-up too."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.oversleep_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds + self.oversleep_s

    def set(self) -> None:
        pass


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(pacing, "time", found)
    return found


def timer_of(clock: Clock) -> PictureTimer:
    timer = PictureTimer(lambda: None)
    timer._wake = clock  # type: ignore[assignment]
    return timer


def handed_over(
    clock: Clock, work_s: list[float], oversleep_s: list[float] | None = None
) -> np.ndarray:
    """Return when each picture is handed over by who works, waits as told, and oversleeps."""
    timer = timer_of(clock)
    times = []
    for n, work in enumerate(work_s):
        clock.now_s += work
        clock.oversleep_s = oversleep_s[n] if oversleep_s else 0.0
        timer.wait_for_picture(n * PERIOD_S)
        times.append(clock.now_s)
    return np.array(times)


@pytest.mark.parametrize("own_s", [0.0, 7.5])
def test_the_first_picture_is_handed_over_at_once_whenever_it_is_due(clock, own_s: float):
    assert timer_of(clock).wait_for_picture(own_s)
    assert clock.now_s == 100.0


def test_the_wait_is_what_is_left_until_the_picture_is_due(clock):
    timer = timer_of(clock)
    timer.wait_for_picture(0.0)
    clock.now_s += 0.25
    timer.wait_for_picture(0.5)
    assert clock.now_s == 100.5
    clock.now_s += 0.5
    timer.wait_for_picture(1.0)
    assert clock.now_s == 101.0


def test_10_000_pictures_do_not_drift_whatever_the_jitter(clock):
    random = np.random.default_rng(2)
    work = random.uniform(0.0, 0.02, 10_000).tolist()
    work[0] = 0.0
    oversleep = random.uniform(0.0, 0.005, 10_000).tolist()
    times = handed_over(clock, work, oversleep)
    late = times - (100.0 + np.arange(10_000) * PERIOD_S)
    assert late.min() > -1e-6
    assert late.max() < 0.005 + 1e-6  # one oversleep, never the sum of two


def test_a_picture_late_within_the_slack_does_not_move_the_schedule(clock):
    work = [0.0] + [0.001] * 99
    work[50] = PERIOD_S + 0.09
    times = handed_over(clock, work)
    due = 100.0 + np.arange(100) * PERIOD_S
    assert times[50] - due[50] > 0.08
    assert np.allclose(times[60:], due[60:])


@pytest.mark.parametrize("pause_s", [0.5, 5.0, 3600.0])
def test_there_is_no_burst_after_a_pause(clock, pause_s: float):
    work = [0.0] + [0.001] * 99
    work[50] = pause_s
    times = handed_over(clock, work)
    assert np.allclose(np.diff(times)[50:], PERIOD_S)


def test_a_decoder_that_is_too_slow_is_never_told_to_wait(clock):
    times = handed_over(clock, [0.05] * 300)
    assert np.allclose(np.diff(times), 0.05)


def read_ahead(
    clock: Clock, work_s: list[float], own_s: list[float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return how long each picture's reading rested before, and when each was handed over.

    Args:
        work_s: How long it takes to read each.
        own_s: Their times in the source; 10 Hz, if not given.
    """
    timer = timer_of(clock)
    rests, times = [], []
    for number, each_s in enumerate(work_s):
        before_s = clock.now_s
        timer.rest()
        rests.append(clock.now_s - before_s)
        clock.now_s += each_s
        timer.wait_for_picture(number * 0.1 if own_s is None else own_s[number])
        times.append(clock.now_s)
    return np.array(rests), np.array(times)


def test_a_picture_is_read_ahead_after_a_rest_that_leaves_the_pace_as_it_is(clock):
    rests, times = read_ahead(clock, [0.04] * 20)
    # The first is due at once; the second is early by 0.1 - 0.04, all others by half of that.
    assert rests == pytest.approx([0, 0, *[0.03] * 18])
    assert np.diff(times) == pytest.approx([0.1] * 19)


def test_nothing_rests_that_is_slow_or_has_become_slow(clock):
    rests, times = read_ahead(clock, [0.04] * 5 + [0.15] * 5)
    assert rests[:5].max() > 0
    assert list(rests[6:]) == [0.0] * 4
    assert np.diff(times)[-3:] == pytest.approx([0.15] * 3)


def test_a_pause_in_a_source_delays_no_picture_after_it(clock):
    own_s = [0.0, 0.03, 0.06, 0.09, 3.12, 3.15, 3.18, 3.21]
    rests, times = read_ahead(clock, [0.01] * 8, own_s)
    assert rests.max() == pytest.approx(0.05)
    # The one after the pause is late by a rest and its reading, the next by its reading alone.
    late_s = times - times[0] - own_s
    assert late_s == pytest.approx([0, 0, 0, 0, 0, 0.05 + 0.01 - 0.03, 0.01, 0.0], abs=1e-9)


def test_when_a_picture_is_due_is_asked_again_only_after_a_change(clock, monkeypatch):
    timer = timer_of(clock)
    assert timer.wait_until(lambda: 0.0)
    dues = iter([1.0, 0.6])

    def wait(_seconds: float) -> None:  # woken each 0.2 s, by a change only the second time
        clock.now_s += 0.2
        if clock.now_s == pytest.approx(100.4):
            timer.settings_changed()

    monkeypatch.setattr(timer._wake, "wait", wait)
    assert timer.wait_until(lambda: next(dues))
    assert clock.now_s == pytest.approx(100.6)


def dues(schedule: Schedule, own: list[float], rates: list[float | None]) -> list[float]:
    """Return when pictures are due that are at these times of their source, at these rates."""
    found = []
    for own_s, rate_hz in zip(own, rates, strict=True):
        schedule.rate_hz = rate_hz
        found.append(schedule.due_s(own_s))
        schedule.advance(own_s, found[-1])
    return found


def test_a_schedule_without_a_rate_is_the_sources_own():
    assert dues(Schedule(), [0.5, 0.7, 2.0], [None] * 3) == [0.5, 0.7, 2.0]


def test_a_schedule_at_a_rate_counts_pictures_whatever_their_own_time():
    assert dues(Schedule(), [0.5, 0.7, 2.0], [4.0] * 3) == [0.0, 0.25, 0.5]


def test_a_schedule_goes_on_at_another_rate_from_the_picture_before():
    own = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    found = dues(Schedule(), own, [4.0, 4.0, 2.0, 2.0, None, None, 10.0])
    # 0, 1/4; then 1/2 each: 0.75, 1.25; then the source's 0.1 each; then 1/10.
    assert found == pytest.approx([0.0, 0.25, 0.75, 1.25, 1.35, 1.45, 1.55])


def test_a_picture_that_is_still_to_come_is_due_by_the_rate_of_now():
    schedule = Schedule()
    dues(schedule, [0.0, 0.1], [4.0, 4.0])
    asked = []
    for schedule.rate_hz in (4.0, 100.0, 0.5, 4.0):
        asked.append(schedule.due_s(0.2))
    assert asked == pytest.approx([0.5, 0.26, 2.25, 0.5])  # 0.25 and one period
