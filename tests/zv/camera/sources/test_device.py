"""Where a device is, and why it cannot be opened; tests/devices has those with real drivers."""

from __future__ import annotations

from pathlib import Path

import pytest

from zenoh_vision.errors import SourceError
from zv.camera.sources import device
from zv.camera.sources.device import DeviceSource, found_again


def test_a_device_that_is_not_there_is_an_error_that_names_it():
    with pytest.raises(SourceError, match=r"^/dev/video9876: "):
        DeviceSource("9876")


def test_what_is_no_video_device_is_said():
    with pytest.raises(SourceError, match=r"^/dev/null: it is no Video4Linux device$"):
        DeviceSource("/dev/null")


@pytest.fixture
def links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in place of /dev/v4l/by-id; the first device there now is called Other."""
    monkeypatch.setattr(device, "stable_name", lambda _device: "/dev/v4l/by-id/Other")
    return tmp_path


def test_a_device_is_where_its_stable_name_is_now_whatever_its_number(links: Path):
    (links / "Webcam").touch()
    assert found_again("/dev/video0", str(links / "Webcam")) == str(links / "Webcam")


def test_another_device_with_its_number_is_not_taken_for_it(links: Path):
    with pytest.raises(SourceError, match=r"another device now .*Other.*Webcam is not there"):
        found_again("/dev/video0", "/dev/v4l/by-id/Webcam")


def test_a_device_without_a_serial_number_in_another_port_is_taken_by_its_number(links: Path):
    assert found_again("/dev/video0", "/dev/v4l/by-path/usb-0:1") == "/dev/video0"


def test_a_device_that_never_was_open_is_where_the_user_says():
    assert found_again("7", None) == "7"
