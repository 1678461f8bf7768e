"""Each kind of control of a real driver, and what it does to the picture."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from tests.support.waiting import wait_until
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter
from zv.camera.sources.device import DeviceSource
from zv.camera.sources.v4l2.controls import Controls
from zv.camera.sources.v4l2.driver import Driver


def one(source: DeviceSource, name: str) -> Parameter:
    found = {each.name: each for each in source.controls.parameters()}
    return found[f"control.{name}"]


@pytest.mark.parametrize(
    ("name", "type_", "value"),
    [
        ("brightness", "int", 200),
        ("hue", "int", -128),
        ("integer_64_bits", "int", -(2**40)),
        ("bitmask", "int", 0x80400000),
        ("boolean", "bool", False),
        ("menu", "str", "Menu Item 4"),
        ("integer_menu", "str", "42"),
        ("string", "str", "ab"),
    ],
)
def test_a_value_of_each_type_is_set_and_read_back(
    opened: DeviceSource, name: str, type_: str, value: Any
):
    assert one(opened, name).type == type_
    assert one(opened, name).value != value
    assert opened.controls.set({name: value}) == {name: value}
    assert one(opened, name).value == value


def test_a_menu_takes_its_numbers_too_and_has_only_the_entries_that_exist(opened: DeviceSource):
    assert one(opened, "menu").choices == ("Menu Item 1", "Menu Item 3", "Menu Item 4")
    assert opened.controls.set({"menu": 1}) == {"menu": "Menu Item 1"}
    with pytest.raises(ParameterRefused, match="Menu Item 1, Menu Item 3, Menu Item 4"):
        opened.controls.set({"menu": 2})


def test_a_button_is_pressed_and_not_kept(opened: DeviceSource):
    assert one(opened, "button").flags == ("write_only",)
    assert opened.controls.set({"button": True}) == {}


def test_a_control_that_is_only_read_cannot_be_set(opened: DeviceSource):
    name = "read_only_integer_32_bits"
    assert one(opened, name).flags == ("read_only",)
    with pytest.raises(ParameterRefused, match="can only be read"):
        opened.controls.set({name: 1})


def test_a_control_is_inactive_while_it_is_automatic(opened: DeviceSource):
    assert one(opened, "gain").flags == ("inactive", "volatile")
    opened.controls.set({"gain_automatic": False})
    assert one(opened, "gain").flags is None
    opened.controls.set({"gain": 7})
    assert one(opened, "gain").value == 7


def test_several_are_set_all_or_none(opened: DeviceSource):
    before = one(opened, "brightness").value
    with pytest.raises(ParameterRefused, match="contrast"):
        opened.controls.set({"brightness": 9, "contrast": 256})
    assert one(opened, "brightness").value == before
    with pytest.raises(ParameterRefused, match="can only be read"):
        opened.controls.set({"brightness": 9, "power_present": 0})
    assert one(opened, "brightness").value == before


def test_a_control_that_the_device_does_not_have_is_refused_with_a_similar_one(
    opened: DeviceSource,
):
    with pytest.raises(ParameterRefused, match="did you mean 'brightness'"):
        opened.controls.set({"brightnes_": 9})


@pytest.fixture
def shown(opened: DeviceSource) -> Callable[[Callable[[np.ndarray], bool]], None]:
    """Wait until a picture is as a condition says; the driver has pictures in its buffers."""

    def wait(condition: Callable[[np.ndarray], bool]) -> None:
        wait_until(lambda: condition(opened.read().picture.pixels), poll_s=0.0)

    return wait


def test_what_is_set_is_in_the_picture(opened: DeviceSource, shown):
    opened.controls.set({"test_pattern": "100% Red", "osd_text_mode": "None"})
    shown(lambda pixels: np.abs(pixels[240, 320] - np.array([0, 0, 255.0])).max() < 5)
    opened.controls.set({"brightness": 255})
    shown(lambda pixels: pixels[240, 320].min() > 90)


def test_values_of_the_settings_are_set_at_the_start_and_what_cannot_be_is_said(
    caplog: pytest.LogCaptureFixture,
):
    given: dict[str, Any] = {"gain": 9, "gain_automatic": False, "nothing": 1, "brightness": 999}
    with closing(DeviceSource(0, controls=given)) as source:
        assert one(source, "gain").value == 9  # though it comes before its switch
    assert "the device has no control 'nothing'" in caplog.text
    assert "control.brightness = 999 is not allowed" in caplog.text


def test_a_change_by_another_program_is_told(opened: DeviceSource):
    told: list[object] = []
    opened.controls.watch(lambda: told.append(one(opened, "brightness").value))
    other = Driver("/dev/video0")
    try:
        Controls(other).set({"brightness": 33})
    finally:
        other.close()

    def heard() -> bool:
        opened.read()
        return 33 in told

    wait_until(heard, poll_s=0.0)
