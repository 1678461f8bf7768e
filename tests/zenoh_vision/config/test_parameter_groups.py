"""Parameters that exist for a time: they come, change, are kept, and go."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

import pytest
from pydantic import Field

from tests.support.library import LampSettings
from zenoh_vision.config.constraints import toml_file
from zenoh_vision.config.parameter_groups import flattened, group_name, table_of
from zenoh_vision.config.revisions import Change, ParameterStore
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter, ParameterList


class LensSettings(LampSettings):
    dials: Annotated[dict[str, Any], Field(default_factory=dict, description="of the group dial")]


class Dials:
    """Two dials, of which one rounds to tens, and one turns by itself."""

    table = "dials"

    def __init__(self) -> None:
        self.values = {"zoom": 0, "heat": 20}
        self.told: Callable[[], None] | None = None
        self.flags = {"heat": ("volatile",)}

    def parameters(self) -> list[Parameter]:
        return [
            Parameter(
                node="",
                name=f"dial.{name}",
                type="int",
                value=value,
                default=0,
                flags=self.flags.get(name),
            )
            for name, value in self.values.items()
        ]

    def set(self, values: Mapping[str, Any]) -> dict[str, Any]:
        for name, value in values.items():
            if name not in self.values or value > 100:
                raise ParameterRefused(f"dial.{name} = {value} is not allowed", "up to 100")
        self.values |= {name: value // 10 * 10 for name, value in values.items()}
        return dict(values)

    def watch(self, told: Callable[[], None] | None) -> None:
        self.told = told


@pytest.fixture
def store() -> ParameterStore[LensSettings]:
    return ParameterStore(LensSettings())


@pytest.fixture
def changes(store: ParameterStore[LensSettings]) -> list[Change[LensSettings]]:
    found: list[Change[LensSettings]] = []
    store.watch(found.append)
    return found


def test_they_come_and_go_as_revisions_that_name_them(store, changes):
    dials = Dials()
    store.add(dials)
    store.remove(dials)
    assert [change.names for change in changes] == [("dial.zoom", "dial.heat")] * 2
    assert [list(change.after.grouped) for change in changes] == [["dial.zoom", "dial.heat"], []]
    assert (store.newest.number, dials.told) == (2, None)


def test_a_change_of_both_kinds_is_one_revision_and_reports_what_the_group_made_of_it(
    store, changes
):
    store.add(Dials())
    change = store.change({"power": 9, "dial.zoom": 57})
    assert set(change.names) == {"power", "dial.zoom"}
    assert (change.after.settings.power, change.after.value("dial.zoom")) == (9, 50)
    assert change.after.number == change.before.number + 1


def test_what_was_set_is_kept_to_be_set_again(store):
    first = Dials()
    store.add(first)
    store.change({"dial.zoom": 57})
    store.remove(first)
    assert store.newest.settings.dials == {"zoom": 57}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"dial.zoom": 101, "power": 9}, "dial.zoom = 101"),
        ({"dial.zoom": 50, "power": 101}, "power = 101"),
        ({"dial.nothing": 1}, "dial.nothing"),
    ],
)
def test_a_refused_change_changes_neither_kind(store, values: dict[str, int], words: str):
    dials = Dials()
    store.add(dials)
    before = store.newest
    with pytest.raises(ParameterRefused, match=words):
        store.change(values)
    assert (store.newest, dials.values["zoom"]) == (before, 0)


def test_without_the_group_its_names_are_unknown(store):
    with pytest.raises(ParameterRefused, match=r"there is no parameter 'dial.zoom'|dial\.zoom"):
        store.change({"dial.zoom": 1})


def test_a_change_of_its_own_is_a_revision_once_the_group_tells(store, changes):
    dials = Dials()
    store.add(dials)
    dials.values["zoom"] = 30
    assert dials.told is not None
    dials.told()
    assert changes[-1].names == ("dial.zoom",)
    assert store.newest.value("dial.zoom") == 30


@pytest.mark.parametrize("flag", ["volatile", "read_only"])
def test_a_value_that_the_device_changes_is_read_and_makes_no_revision(store, changes, flag: str):
    dials = Dials()
    dials.flags = {"heat": (flag,)}
    store.add(dials)
    dials.values["heat"] = 99
    assert store.current().value("dial.heat") == 99
    assert (store.newest.number, len(changes)) == (1, 1)


def test_a_group_that_came_in_the_place_of_another_stays_when_that_goes(store):
    first, second = Dials(), Dials()
    store.add(first)
    store.add(second)
    store.remove(first)
    assert "dial.zoom" in store.newest.grouped


def test_tables_and_groups_have_names_of_each_other():
    assert (group_name("controls"), table_of("control.gain"), table_of("power")) == (
        "control",
        ("controls", "gain"),
        None,
    )
    assert flattened({"power": 1, "controls": {"gain": 2}}) == {"power": 1, "control.gain": 2}


def test_a_dump_has_a_table_of_them_in_which_what_cannot_be_set_is_a_comment():
    def one(name: str, value: int, *flags: str) -> Parameter:
        return Parameter(
            node="a", name=name, type="int", value=value, default=0, flags=flags or None
        )

    listed = ParameterList(
        node="a",
        revision=1,
        parameters=(one("dial.zoom", 5), one("dial.heat", 7, "read_only"), one("power", 1)),
    )
    written = [line for line in toml_file(listed).splitlines() if line and line[:3] != "# ;"]
    assert written[-3:] != []
    text = toml_file(listed)
    assert text.index("power = 1") < text.index("[dials]") < text.index("\nzoom = 5")
    assert "\n# heat = 7" in text
