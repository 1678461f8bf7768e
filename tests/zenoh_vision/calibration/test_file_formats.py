"""Calibrations in the formats of OpenCV and of ROS, whose lens is known by hand, are read alike."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from zenoh_vision.calibration.ros_yaml import read_calibration
from zenoh_vision.errors import ConfigurationError

K = (600.0, 0.0, 350.0, 0.0, 601.0, 215.0, 0.0, 0.0, 1.0)
D = (-0.25, 0.08, 0.001, -0.0008, 0.01)

NUMPY = """\
image_width: 640
image_height: 480
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [ 600. 0. 350. 0. 601. 215.
          0. 0. 1. ]
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.25 0.08 1e-3 -0.0008 0.01]
"""

INI = """\
# oST version 5.0 parameters

[image]

width
640

height
480

[narrow_stereo/left]

camera matrix
600.000000 0.000000 350.000000
0.000000 601.000000 215.000000
0.000000 0.000000 1.000000

distortion
-0.250000 0.080000 0.001000 -0.000800 0.010000

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
590.000000 0.000000 351.000000 0.000000
0.000000 592.000000 216.000000 0.000000
0.000000 0.000000 1.000000 0.000000
"""


def opencv_file(path: Path, d: tuple[float, ...] = D, fisheye: int | None = None) -> Path:
    """Write a calibration with OpenCV itself, under the keys of its calibration sample."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", 640)
    file.write("image_height", 480)
    if fisheye is not None:
        file.write("fisheye_model", fisheye)
    file.write("camera_matrix", np.reshape(K, (3, 3)))
    file.write("distortion_coefficients", np.reshape(d, (-1, 1)))
    file.write("avg_reprojection_error", 0.21)
    file.release()
    return path


def test_what_opencv_writes_is_read(tmp_path: Path):
    found = read_calibration(opencv_file(tmp_path / "camera.yml")).camera
    assert (found.width, found.height, found.k, found.d) == (640, 480, K, D)
    assert found.distortion_model == "plumb_bob"


def test_opencvs_eight_coefficients_and_its_fisheye_are_their_models_in_ros(tmp_path: Path):
    eight = (0.1, 0.2, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6)
    found = read_calibration(opencv_file(tmp_path / "eight.yml", eight)).camera
    assert (found.distortion_model, found.d) == ("rational_polynomial", eight)
    four = (0.01, 0.02, 0.003, 0.004)
    found = read_calibration(opencv_file(tmp_path / "fisheye.yml", four, fisheye=1)).camera
    assert (found.distortion_model, found.d) == ("equidistant", four)


def test_opencvs_older_names_are_known(tmp_path: Path):
    path = opencv_file(tmp_path / "camera.yml")
    text = path.read_text()
    for ours, theirs in (
        ("image_width", "image_Width"),
        ("camera_matrix", "Camera_Matrix"),
        ("distortion_coefficients", "Distortion_Coefficients"),
    ):
        text = text.replace(ours, theirs)
    path.write_text(text)
    assert read_calibration(path).camera.k == K


def test_numbers_that_only_spaces_separate_are_read(tmp_path: Path):
    path = tmp_path / "front.yaml"
    path.write_text(NUMPY)
    assert read_calibration(path).camera.k == K
    assert read_calibration(path).camera.d == D


def test_the_ini_of_ros_is_read(tmp_path: Path):
    path = tmp_path / "front.ini"
    path.write_text(INI)
    found = read_calibration(path)
    assert (found.camera.width, found.camera.height) == (640, 480)
    assert (found.camera.k, found.camera.d, found.name) == (K, D, "narrow_stereo/left")
    assert found.p[:3] == (590, 0, 351)


def test_a_url_of_a_file_and_a_byte_order_mark_do_not_matter(tmp_path: Path):
    for name, text in (("front.ini", INI), ("front.yaml", NUMPY)):
        path = tmp_path / name
        path.write_bytes(b"\xef\xbb\xbf" + text.encode())
        assert read_calibration(f"file://{path}").camera.k == K


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[image]\nwidth\n640\n", "image_height: missing"),
        (INI.replace("601.000000 215", "215"), "camera_matrix.data: 8 numbers"),
        (INI.replace("width\n640", "width\nmany"), "image_width: missing"),
        ("%YAML:1.0\n---\ncamera_matrix: !!python/object:os.system {}\n", "not YAML"),
    ],
    ids=["short", "too few", "no number", "hostile"],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, said: str):
    path = tmp_path / "front.ini"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=f"front.ini: .*{said}"):
        read_calibration(path)
