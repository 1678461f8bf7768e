"""A driver that refuses calls which others answer; tests/devices has those that exist."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from typing import Any, ClassVar

import pytest
from videodev2 import videodev2 as v4l2

from zenoh_vision.errors import SourceError
from zenoh_vision.host import video_devices
from zv.camera.sources import device
from zv.camera.sources.base import DeviceWish
from zv.camera.sources.device import DeviceSource
from zv.camera.sources.v4l2.controls import Controls

GAIN = 7


class Driver:
    """Has one control, which can be set and not be read."""

    captures: ClassVar[bool] = True
    type: ClassVar[int] = int(v4l2.V4L2_BUF_TYPE_VIDEO_CAPTURE)

    def __init__(self) -> None:
        self.written: list[int] = []
        self.error = self.end_of_controls = errno.EINVAL

    def call(self, request: int, argument: Any) -> Any:
        if request == v4l2.VIDIOC_QUERY_EXT_CTRL and argument.id & 0xFFFFFF < GAIN:
            argument.id, argument.name = GAIN, b"Gain"
            argument.type = v4l2.V4L2_CTRL_TYPE_INTEGER
            argument.minimum, argument.maximum, argument.step = 0, 100, 1
            return argument
        if request == v4l2.VIDIOC_QUERY_EXT_CTRL:
            raise OSError(self.end_of_controls, os.strerror(self.end_of_controls))
        if request == v4l2.VIDIOC_S_EXT_CTRLS:
            self.written.append(argument.controls[0].u.value)
            return argument
        if request == v4l2.VIDIOC_G_EXT_CTRLS:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        raise OSError(self.error, os.strerror(self.error))

    def listed(self, request: int, argument: Any) -> Any:
        raise OSError(self.error, os.strerror(self.error))

    def close(self) -> None:
        pass


def test_a_control_that_cannot_be_read_is_set_all_the_same():
    driver = Driver()
    controls = Controls(driver)  # type: ignore[arg-type]
    assert controls.set({"gain": 9}) == {"gain": 9}
    assert list(controls.apply({"gain": 10})) == []
    assert driver.written == [9, 10]
    assert [each.value for each in controls.parameters()] == [None]


def test_a_driver_that_fails_at_a_control_has_those_before_it(caplog: pytest.LogCaptureFixture):
    driver = Driver()
    driver.end_of_controls = errno.EIO
    controls = Controls(driver)  # type: ignore[arg-type]
    assert [each.name for each in controls.parameters()] == ["control.gain"]
    assert caplog.messages == ["the driver lists no controls after gain: Input/output error"]
    driver.end_of_controls = errno.ENODEV
    assert controls.parameters() == []


@pytest.fixture
def opening(monkeypatch: pytest.MonkeyPatch) -> Callable[[Driver], DeviceSource]:
    def open_it(driver: Driver) -> DeviceSource:
        monkeypatch.setattr(video_devices, "why_not", lambda _name: "")
        monkeypatch.setattr(device, "Driver", lambda _name: driver)
        return DeviceSource("/dev/video3")

    return open_it


def test_a_call_that_an_open_device_refuses_is_not_said_to_make_it_no_video_device(
    opening: Callable[[Driver], DeviceSource],
):
    with pytest.raises(SourceError) as caught:
        opening(Driver())
    words = "the driver refuses a call that is needed (Invalid argument)"
    assert str(caught.value) == f"/dev/video3: {words}"


def test_a_wish_of_a_device_that_is_gone_is_refused_in_words(monkeypatch: pytest.MonkeyPatch):
    driver = Driver()
    driver.error = errno.ENODEV
    source = DeviceSource.__new__(DeviceSource)
    source._name, source._driver = "/dev/video3", driver  # type: ignore[assignment]
    source._offers = []

    def gone(*_args: object) -> None:
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))

    monkeypatch.setattr(device, "choose", gone)
    with pytest.raises(SourceError, match=r"^/dev/video3: No such device$"):
        source.check(DeviceWish(width=640))
