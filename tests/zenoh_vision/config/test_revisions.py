"""Settings in revisions: all of a change or none, and one revision for a frame."""

from __future__ import annotations

import threading

import pytest

import zenoh_vision.config.revisions
from tests.support.library import LampSettings
from zenoh_vision.config.revisions import Change, ParameterStore
from zenoh_vision.errors import ParameterRefused

Store = ParameterStore[LampSettings]
Changed = Change[LampSettings]


@pytest.fixture
def live() -> Store:
    return ParameterStore(LampSettings())


def test_it_begins_with_revision_0(live: Store):
    assert (live.newest.number, live.active.number) == (0, 0)
    assert live.active.settings == LampSettings()


def test_a_change_is_one_revision_however_many_values_it_has(live: Store):
    change = live.change({"low": 3.0, "high": 4.0, "power": 50})
    assert (change.before.number, change.after.number) == (0, 1)
    assert change.names == ("low", "high")  # power was 50
    assert live.newest is change.after
    assert (change.after.settings.low, change.after.settings.high) == (3.0, 4.0)


def test_a_frame_in_work_keeps_its_revision(live: Store):
    live.activate()
    live.change({"power": 1})
    assert (live.active.number, live.active.settings.power) == (0, 50)
    assert live.activate().number == 1
    assert live.active.settings.power == 1


@pytest.fixture
def told(live: Store) -> list[Changed]:
    """The changes that a watcher was told of."""
    found: list[Changed] = []
    live.watch(found.append)
    return found


@pytest.mark.parametrize("values", [{}, {"power": 50}, {"low": 1, "camera": "front"}])
def test_what_changes_nothing_is_no_revision(live: Store, told: list[Changed], values: dict):
    change = live.change(values)
    assert (change.names, change.before, change.after) == ((), live.newest, live.newest)
    assert (live.newest.number, told) == (0, [])


def test_a_refused_change_leaves_everything_as_it_is(live: Store, told: list[Changed]):
    before = live.newest
    with pytest.raises(ParameterRefused):
        live.change({"power": 1, "on": False, "high": 99})
    assert live.newest is before
    assert told == []


def test_watchers_are_told_of_each_change_in_order(live: Store, told: list[Changed]):
    live.change({"power": 1})
    live.change({"on": False, "label": "x"})
    assert [(c.after.number, c.names) for c in told] == [(1, ("power",)), (2, ("on", "label"))]


def test_a_change_waits_for_one_that_is_being_checked_and_loses_nothing_of_it(
    live: Store, monkeypatch: pytest.MonkeyPatch
):
    checked, go_on = threading.Event(), threading.Event()
    check = zenoh_vision.config.revisions.changed

    def slow(settings: LampSettings, values: dict[str, object], others: object) -> LampSettings:
        if "power" in values:
            checked.set()
            assert go_on.wait(10)
        return check(settings, values, ())

    monkeypatch.setattr(zenoh_vision.config.revisions, "changed", slow)
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


def test_of_changes_that_come_at_once_no_mix_is_ever_seen(live: Store):
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
        power, seed, label = of(live.activate().settings)
        assert (seed, label) in ((power, f"{power}"), (0, ""))  # the latter before the first
    assert len(seen) == live.newest.number >= writers
    assert all((seed, label) == (power, f"{power}") for power, seed, label in seen)


def test_a_watcher_may_change_the_parameters_again_and_each_change_is_told_in_order(live: Store):
    told: list[int] = []

    def watcher(change: Changed) -> None:
        told.append(change.after.number)
        if change.after.number < 3:  # with the lock held this would never return
            live.change({"seed": change.after.number})

    live.watch(watcher)
    live.change({"power": 9})
    assert told == [1, 2, 3]


def test_a_watcher_that_fails_does_not_keep_the_others_from_being_called(live: Store, caplog):
    told: list[int] = []

    def failing(_change: Changed) -> None:
        raise RuntimeError("no network")

    live.watch(failing)
    live.watch(lambda change: told.append(change.after.number))
    live.change({"power": 9})
    live.change({"power": 8})
    assert told == [1, 2]
    assert "a watcher of parameters failed" in caplog.text
