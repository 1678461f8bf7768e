"""The devices of a machine, and why one cannot be opened."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from zenoh_vision.host import video_devices

BY_ID = "dev/v4l/by-id/usb-046d_HD_Webcam_AB12-video-index0"
BY_PATH = "dev/v4l/by-path/pci-0000:00:14.0-usb-0:2:1.0-video-index0"


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A machine with three devices: one without stable names, one without a readable name."""
    for number, name in [(0, "Integrated Camera"), (2, "HD Webcam"), (10, None)]:
        node = tmp_path / f"dev/video{number}"
        node.parent.mkdir(exist_ok=True)
        node.touch()
        if name is not None:
            folder = tmp_path / f"sys/class/video4linux/video{number}"
            folder.mkdir(parents=True)
            (folder / "name").write_text(name + "\n")
    for link in (BY_ID, BY_PATH):
        (tmp_path / link).parent.mkdir(parents=True)
        (tmp_path / link).symlink_to("../../video2")
    (tmp_path / "dev/video-something").touch()
    return tmp_path


def test_the_stable_paths_of_a_device_begin_with_that_by_its_serial_number(machine: Path):
    assert video_devices.stable_paths(machine / "dev/video2", machine) == [
        f"/{BY_ID}",
        f"/{BY_PATH}",
    ]
    assert video_devices.stable_paths(machine / "dev/video0", machine) == []


def test_a_missing_device_is_explained_with_those_that_exist_by_stable_paths(machine: Path):
    assert video_devices.why_not("/dev/video7", machine) == (
        "there is no such device; there are: /dev/video0 (Integrated Camera), "
        f"/{BY_ID} (/dev/video2, HD Webcam), /dev/video10"
    )


def test_a_machine_without_devices_is_told_what_needs_none(tmp_path: Path):
    said = video_devices.why_not("/dev/video0", tmp_path)
    assert "no video device" in said
    assert "--source synthetic" in said


def test_missing_permission_is_said_with_the_way_out(
    machine: Path, monkeypatch: pytest.MonkeyPatch
):
    # Root may read everything, so taking the permission away would not do.
    monkeypatch.setattr(os, "access", lambda *_: False)
    said = video_devices.why_not("/dev/video0", machine)
    assert "permission is missing" in said
    assert "sudo usermod -aG video $USER" in said


def test_nothing_is_said_of_a_device_that_is_there(machine: Path):
    assert video_devices.why_not("/dev/video0", machine) == ""
