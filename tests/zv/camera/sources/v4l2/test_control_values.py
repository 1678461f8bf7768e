"""What a control takes and shows, by its type."""

from __future__ import annotations

from typing import Any

import pytest
from videodev2 import videodev2 as v4l2

from zenoh_vision.errors import ParameterRefused
from zv.camera.sources.v4l2.controls import Control


def control(kind: int, low: int = 0, high: int = 1, **others: Any) -> Control:
    given = {"step": 1, "default": low, "flags": frozenset[str](), "menu": {}, **others}
    return Control("it", "It", 1, int(kind), low, high, **given)


GAIN = control(v4l2.V4L2_CTRL_TYPE_INTEGER, -10, 100, step=5)
WIDE = control(v4l2.V4L2_CTRL_TYPE_INTEGER64, -(2**63), 2**63 - 1)
AUTO = control(v4l2.V4L2_CTRL_TYPE_BOOLEAN)
PRESS = control(v4l2.V4L2_CTRL_TYPE_BUTTON)
MODE = control(v4l2.V4L2_CTRL_TYPE_MENU, 0, 3, menu={1: "Manual Mode", 3: "Aperture Priority Mode"})
LINK = control(v4l2.V4L2_CTRL_TYPE_INTEGER_MENU, 0, 1, menu={0: "450000000", 1: "900000000"})
LABEL = control(v4l2.V4L2_CTRL_TYPE_STRING, 2, 4)
MASK = control(v4l2.V4L2_CTRL_TYPE_BITMASK, 0, 0x80FF0000)


@pytest.mark.parametrize(
    ("one", "value", "raw"),
    [
        (GAIN, -10, -10),
        (GAIN, 100, 100),
        (GAIN, 7, 7),  # the driver rounds to its steps
        (WIDE, -(2**63), -(2**63)),
        (AUTO, True, 1),
        (AUTO, False, 0),
        (PRESS, True, 1),
        (MODE, "Manual Mode", 1),
        (MODE, 3, 3),
        (LINK, "900000000", 1),
        (LABEL, "ab", "ab"),
        (MASK, 0x80000000, 0x80000000),
    ],
)
def test_a_value_of_its_type_is_taken(one: Control, value: object, raw: object):
    assert one.raw(value) == raw


@pytest.mark.parametrize(
    ("one", "value", "allowed"),
    [
        (GAIN, -11, "a whole number from -10 to 100 in steps of 5"),
        (GAIN, 101, "a whole number from -10 to 100 in steps of 5"),
        (GAIN, 5.0, "a whole number from -10 to 100 in steps of 5"),
        (GAIN, True, "a whole number from -10 to 100 in steps of 5"),
        (GAIN, None, "a whole number from -10 to 100 in steps of 5"),
        (AUTO, 1, "true or false"),
        (PRESS, False, "true"),
        (MODE, "Manual", "one of Manual Mode, Aperture Priority Mode"),
        (MODE, 0, "one of Manual Mode, Aperture Priority Mode"),
        (MODE, True, "one of Manual Mode, Aperture Priority Mode"),
        (LABEL, "a", "a text of 2 to 4 bytes"),
        (LABEL, "ööö", "a text of 2 to 4 bytes"),
    ],
)
def test_another_value_is_refused_with_what_is_allowed(one: Control, value: object, allowed: str):
    with pytest.raises(ParameterRefused, match=r"control\.it = ") as caught:
        one.raw(value)
    assert caught.value.allowed == allowed


def test_a_value_is_shown_as_it_is_set():
    assert [MODE.shown(1), MODE.shown(2), AUTO.shown(1), GAIN.shown(-3)] == [
        "Manual Mode",
        "2",
        True,
        -3,
    ]
    assert MASK.shown(-(2**31)) == 2**31  # drivers report it with a sign
