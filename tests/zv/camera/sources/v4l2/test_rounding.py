"""A driver that rounds a value to its steps: what is reported is what it made of it."""

from __future__ import annotations

import errno
from typing import Any

import pytest
from videodev2 import videodev2 as v4l2

from zenoh_vision.errors import ParameterRefused
from zv.camera.sources.v4l2.controls import Controls

FOCUS, AUTO = 1, 2


class RoundingDriver:
    """Two controls: a focus in steps of 5, which cannot be set while ``auto`` is on."""

    def __init__(self) -> None:
        self.values = {FOCUS: 0, AUTO: 1}

    def call(self, request: int, argument: Any) -> Any:
        if request == v4l2.VIDIOC_QUERY_EXT_CTRL:
            return self.describe(argument)
        if request == v4l2.VIDIOC_G_EXT_CTRLS:
            argument.controls[0].u.value = self.values[argument.controls[0].id]
        elif request == v4l2.VIDIOC_S_EXT_CTRLS:
            number, value = argument.controls[0].id, argument.controls[0].u.value
            if number == FOCUS and self.values[AUTO]:
                raise OSError(errno.EACCES, "Permission denied")
            self.values[number] = value // 5 * 5 if number == FOCUS else value
        else:
            raise OSError(errno.ENOTTY, "no such call")
        return argument

    def describe(self, argument: Any) -> Any:
        number = (argument.id & 0xFFFF) + 1
        if number > AUTO:
            raise OSError(errno.EINVAL, "no more")
        argument.id = number
        argument.name = b"Focus, Absolute" if number == FOCUS else b"Focus, Auto"
        argument.type = (
            v4l2.V4L2_CTRL_TYPE_INTEGER if number == FOCUS else v4l2.V4L2_CTRL_TYPE_BOOLEAN
        )
        argument.maximum, argument.step = (250, 5) if number == FOCUS else (1, 1)
        off = number == FOCUS and self.values[AUTO]
        argument.flags = v4l2.V4L2_CTRL_FLAG_INACTIVE if off else 0
        return argument


@pytest.fixture
def controls() -> Controls:
    return Controls(RoundingDriver())  # type: ignore[arg-type]


def value(controls: Controls) -> object:
    return controls.parameters()[0].value


def test_a_value_is_reported_as_the_driver_rounded_it(controls: Controls):
    controls.set({"focus_auto": False, "focus_absolute": 13})
    focus = controls.parameters()[0]
    assert (focus.name, focus.value, focus.step) == ("control.focus_absolute", 10, 5.0)


def test_a_rounded_value_of_the_settings_is_said_and_switches_are_set_first(controls: Controls):
    said = list(controls.apply({"focus_absolute": 13, "focus_auto": False}))
    assert said == ["control.focus_absolute = 13 was set, and the driver made it 10"]


def test_what_is_automatic_is_refused_in_words(controls: Controls):
    with pytest.raises(
        ParameterRefused, match=r"without effect now, such as while it is automatic"
    ):
        controls.set({"focus_absolute": 10})
    assert value(controls) == 0


def test_a_change_that_the_driver_refuses_half_way_is_taken_back(controls: Controls):
    controls.set({"focus_auto": False, "focus_absolute": 20})
    with pytest.raises(ParameterRefused):
        controls.set({"focus_auto": True, "focus_absolute": 50})
    assert [one.value for one in controls.parameters()] == [20, False]
