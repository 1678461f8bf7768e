"""Settings in revisions: all of a change or none, and one revision for a frame."""

from __future__ import annotations

import threading

import pytest

import common.live
from common.errors import ParameterRefused
from common.live import Change, LiveSettings
from tests.common.live_settings import LampSettings


@pytest.fixture
def live() -> LiveSettings[LampSettings]:
    return LiveSettings(LampSettings())


def test_it_begins_with_revision_0(live: LiveSettings[LampSettings]):
    assert (live.newest.number, live.in_force.number) == (0, 0)
    assert live.settings == LampSettings()


def test_a_change_is_one_revision_however_many_values_it_has(live: LiveSettings[LampSettings]):
    change = live.change({"low": 3.0, "high": 4.0, "power": 50})
    assert (change.before.number, change.after.number) == (0, 1)
    assert change.names == ("low", "high")  # power was 50
    assert live.newest is change.after
    assert (change.after.settings.low, change.after.settings.high) == (3.0, 4.0)


def test_a_frame_in_work_keeps_its_revision(live: LiveSettings[LampSettings]):
    live.take()
    live.change({"power": 1})
    assert (live.in_force.number, live.settings.power) == (0, 50)
    assert live.take().number == 1
    assert live.settings.power == 1


@pytest.mark.parametrize("values", [{}, {"power": 50}, {"low": 1, "camera": "front"}])
def test_what_changes_nothing_is_no_revision(live: LiveSettings[LampSettings], values: dict):
    told: list[Change[LampSettings]] = []
    live.watch(told.append)
    change = live.change(values)
    assert (change.names, change.before, change.after) == ((), live.newest, live.newest)
    assert (live.newest.number, told) == (0, [])


def test_a_refused_change_leaves_everything_as_it_is(live: LiveSettings[LampSettings]):
    told: list[Change[LampSettings]] = []
    live.watch(told.append)
    before = live.newest
    with pytest.raises(ParameterRefused):
        live.change({"power": 1, "on": False, "high": 99})
    assert live.newest is before
    assert told == []


def test_watchers_are_told_of_each_change_in_order(live: LiveSettings[LampSettings]):
    told: list[tuple[int, tuple[str, ...], int]] = []
    live.watch(lambda c: told.append((c.after.number, c.names, live.newest.number)))
    live.change({"power": 1})
    live.change({"on": False, "label": "x"})
    assert told == [(1, ("power",), 1), (2, ("on", "label"), 2)]


def test_a_change_waits_for_one_that_is_being_checked_and_loses_nothing_of_it(
    live: LiveSettings[LampSettings], monkeypatch: pytest.MonkeyPatch
):
    checked, go_on = threading.Event(), threading.Event()
    check = common.live.changed

    def slow(settings: LampSettings, values: dict[str, object]) -> LampSettings:
        if "power" in values:
            checked.set()
            assert go_on.wait(10)
        return check(settings, values)

    monkeypatch.setattr(common.live, "changed", slow)
    first = threading.Thread(target=live.change, args=({"power": 1},), daemon=True)
    second = threading.Thread(target=live.change, args=({"seed": 2},), daemon=True)
    first.start()
    assert checked.wait(10)
    second.start()
    second.join(0.1)
    assert second.is_alive()
    go_on.set()
    for thread in (first, second):
        thread.join(10)
    settings = live.newest.settings
    assert (live.newest.number, settings.power, settings.seed) == (2, 1, 2)


def test_of_changes_that_come_at_once_no_mix_is_ever_seen(live: LiveSettings[LampSettings]):
    """Each writer sets all of its values to one number; a mix would have two."""
    writers, rounds = 4, 50
    seen: list[tuple[int, int, str]] = []
    live.watch(lambda c: seen.append(of(c.after.settings)))
    start = threading.Barrier(writers + 1)

    def of(settings: LampSettings) -> tuple[int, int, str]:
        return settings.power, settings.seed, settings.label

    def write(writer: int) -> None:
        start.wait(10)
        for turn in range(rounds):
            number = writer * 25 + turn % 25
            live.change({"power": number, "seed": number, "label": f"{number}"})

    threads = [threading.Thread(target=write, args=(n,), daemon=True) for n in range(writers)]
    for thread in threads:
        thread.start()
    start.wait(10)
    while any(thread.is_alive() for thread in threads):
        power, seed, label = of(live.take().settings)
        assert (seed, label) in ((power, f"{power}"), (0, ""))  # the latter before the first
    assert len(seen) == live.newest.number >= writers
    assert all((seed, label) == (power, f"{power}") for power, seed, label in seen)
