"""The camera's calibration on the wire: latched, scaled, refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.listening import Listener, newest
from tests.support.processes import START_S
from tests.support.waiting import wait_until
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.calibration.ros_yaml import write_calibration
from zenoh_vision.messages import CameraInfo

KEY = "vision/front/camera_info"
HEALTH = "@vision/diagnostics/camera_front"
SMALL = ("--width", 320, "--height", 240, "--rate", 20)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Of a camera with twice the synthetic picture's width and height."""
    lens = CameraModel(
        640, 480, (500.0, 0, 319.5, 0, 500, 239.5, 0, 0, 1), "plumb_bob", (-0.1,) * 4
    )
    path = tmp_path / "front.yaml"
    write_calibration(Calibration(lens, plane=Plane((1, 0, 0, 0, 1, 0, 0, 0, 1))), path)
    return path


def test_it_is_told_before_the_first_frame_and_asked_for_later(client, service, file: Path):
    told = Listener(client, KEY)
    service("camera", *SMALL, "--calibration", file)
    (message,) = told.wait_for(1, START_S)
    assert message.encoding == "application/msgpack;vision.CameraInfo.v1"
    info = CameraInfo.from_bytes(message.payload)
    assert (info.width, info.height, info.k[0]) == (320, 240, 250)
    assert info.header.seq == 0
    assert newest(client, KEY).payload == message.payload
    frames = Listener(client, "vision/front/image/compressed")
    frames.wait_for(5, START_S)
    assert len(told.messages) == 1


def test_another_shape_is_said_in_the_cameras_health(client, service, file: Path):
    health = Listener(client, HEALTH)
    camera = service("camera", "--width", 320, "--height", 200, "--calibration", file)

    def said() -> bool:
        return any("320x200; allowed: 640x480" in each.body["message"] for each in health.messages)

    wait_until(said, START_S, lambda: camera.complaints)
    assert "no camera_info: picture: 320x200" in camera.complaints


def test_a_camera_does_not_start_with_a_file_that_is_wrong_or_missing(service, tmp_path: Path):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("image_width: 640\n")
    for path, status, says in (
        (wrong, 2, f"{wrong}: image_height: missing"),
        (tmp_path / "none.yaml", 3, "none.yaml: No such file"),
    ):
        camera = service("camera", *SMALL, "--calibration", path)
        assert camera.process.wait(START_S) == status
        assert says in camera.complaints
