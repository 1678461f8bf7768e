"""The controls of a device that are no single values, arrays and structures: only listed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from videodev2 import videodev2 as v4l2

from zv.camera.sources.v4l2.controls import MOST, name_of
from zv.camera.sources.v4l2.driver import Driver

NEXT: Final = int(v4l2.V4L2_CTRL_FLAG_NEXT_COMPOUND)
DYNAMIC: Final = 0x0800
"""V4L2_CTRL_FLAG_DYNAMIC_ARRAY: it has any number of elements up to its dimension."""

ELEMENTS: Final = {
    int(v4l2.V4L2_CTRL_TYPE_INTEGER): "s32",
    int(v4l2.V4L2_CTRL_TYPE_INTEGER64): "s64",
    int(v4l2.V4L2_CTRL_TYPE_BOOLEAN): "bool",
    int(v4l2.V4L2_CTRL_TYPE_U8): "u8",
    int(v4l2.V4L2_CTRL_TYPE_U16): "u16",
    int(v4l2.V4L2_CTRL_TYPE_U32): "u32",
}
"""Types of the elements of arrays, as ``v4l2-ctl`` names them."""


def compound_controls(driver: Driver) -> Iterator[tuple[str, str]]:
    """Yield the name of each array and structure, and its form: ``16x16 u8``."""
    asked: Any = v4l2.v4l2_query_ext_ctrl()
    asked.id = NEXT
    for _ in range(MOST):
        try:
            driver.call(v4l2.VIDIOC_QUERY_EXT_CTRL, asked)
        except OSError:  # there are no more, or the driver knows none
            return
        sizes = "x".join(str(asked.dims[index]) for index in range(asked.nr_of_dims))
        element = ELEMENTS.get(int(asked.type), f"structure of {asked.elem_size} bytes")
        most = "up to " if asked.flags & DYNAMIC else ""
        yield name_of(asked.name, asked.id, {}), f"{most}{sizes} {element}".strip()
        asked.id |= NEXT
