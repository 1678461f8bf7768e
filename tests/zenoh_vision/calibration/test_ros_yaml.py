"""The calibration file: what ROS writes is read, what is written is ROS', the rest is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.support.headers import header
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.calibration.ros_yaml import read_calibration, write_calibration
from zenoh_vision.errors import ConfigurationError, PayloadError, SourceError
from zenoh_vision.messages import CameraInfo

# In the form of camera_calibration_parsers: yaml-cpp writes floats as C++ does, also 5e-05.
ROS = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.783367, 0.000000, 305.593336, 0.000000, 437.302876, 243.738352, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 5e-05, 0.000524, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.653800, 0, 322.797939, 0, 0, 393.653800, 241.090902, 0, 0, 0, 1, 0]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "front.yaml"


def test_a_file_that_ros_wrote_is_read_and_other_keys_are_ignored(path: Path):
    path.write_text(ROS + "calibrated_by: somebody\n")
    found = read_calibration(path)
    assert (found.camera.width, found.camera.height, found.name) == (640, 480, "narrow_stereo")
    assert found.camera.k[:6] == (438.783367, 0, 305.593336, 0, 437.302876, 243.738352)
    assert found.camera.d == (-0.361976, 0.110510, 5e-05, 0.000524, 0)
    assert found.p[:3] == (393.6538, 0, 322.797939)
    assert found.plane is None


def test_what_is_written_has_exactly_the_keys_of_ros_and_is_read_back(path: Path):
    path.write_text(ROS)
    found = read_calibration(path)
    write_calibration(found, path)
    assert yaml.safe_load(path.read_text()).keys() == yaml.safe_load(ROS).keys()
    assert path.read_text().startswith("image_width: 640\nimage_height: 480\ncamera_name:")
    assert read_calibration(path) == found


def test_the_plane_is_one_more_key(path: Path):
    camera = CameraModel(640, 480, (500.0, 0, 320, 0, 500, 240, 0, 0, 1), "equidistant", (0.1,) * 4)
    with_plane = Calibration(camera, "belt", plane=Plane((1, 0, 0, 0, 2, 0, 0, 1e-3, 1)))
    write_calibration(with_plane, path)
    assert set(yaml.safe_load(path.read_text())) - set(yaml.safe_load(ROS)) == {"plane_homography"}
    assert read_calibration(path) == with_plane


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("image_width: 640", "image_width: wide", "image_width: 'wide'; allowed: a whole number"),
        ("image_width: 640", "image_width: 0", "image_width: 0; allowed: 1 to 65535"),
        ("image_height: 480\n", "", "image_height: missing"),
        ("image_height", "image_hieght", "image_hieght: unknown key, did you mean image_height"),
        ("plumb_bob", "bulb_plum", "distortion_model: 'bulb_plum'; allowed: plumb_bob, rational"),
        ("[438.783367, ", "[", "camera_matrix.data: 8 numbers; allowed: 9: 3 rows of 3"),
        ("438.783367", "-438", "camera_matrix.data: .*fx and fy above 0"),
        ("438.783367", ".nan", "camera_matrix.data: nan; allowed: finite numbers"),
        ("438.783367", "about 400", "camera_matrix.data: 'about 400'; allowed: numbers"),
        ("  cols: 4", "  cols: 5", "projection_matrix.cols: 5; allowed: 4"),
        (", 5e-05, 0.000524", "", "distortion_coefficients.data: 3 numbers; allowed: 0 or 4 or 5"),
        ("data: [-0.36", "date: [-0.36", "distortion_coefficients.data: None; allowed: a list"),
        ("camera_name: narrow_stereo", "camera_name: [1]", "camera_name: .*allowed: a text"),
        (ROS, "", "no keys; allowed: image_width"),
        (ROS, "[" * 5000, "not YAML"),
        (ROS, "a: b: c", "not YAML: .*line 1"),
        (ROS, "\x00\x01", "not YAML"),
        (ROS, "#" * 70_000, "over 65536 bytes"),
    ],
)
def test_a_bad_file_is_refused_naming_file_key_and_what_is_allowed(
    path: Path, old: str, new: str, says: str
):
    assert old in ROS
    path.write_text(ROS.replace(old, new))
    with pytest.raises(ConfigurationError, match=says) as caught:
        read_calibration(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("data", ["[0, 0, 0, 0, 0, 0, 0, 0, 0]", "[1, 2, 3, 4]", "nil"])
def test_an_invalid_plane_is_refused(path: Path, data: str):
    path.write_text(f"{ROS}plane_homography:\n  rows: 3\n  cols: 3\n  data: {data}\n")
    with pytest.raises(ConfigurationError, match=r"plane_homography.data: .*; allowed: "):
        read_calibration(path)


def test_a_file_that_cannot_be_opened_or_written_is_named(path: Path):
    with pytest.raises(SourceError, match=r"front\.yaml: No such file"):
        read_calibration(path)
    camera = CameraModel(64, 48, (50.0, 0, 32, 0, 50, 24, 0, 0, 1))
    with pytest.raises(SourceError, match="nowhere"):
        write_calibration(Calibration(camera), path.parent / "nowhere" / "front.yaml")
    assert not list(path.parent.iterdir())
    path.write_text("a file, not a folder")
    with pytest.raises(SourceError, match=r"front\.yaml/other\.yaml: Not a directory"):
        write_calibration(Calibration(camera), path / "other.yaml")


# The message.

HEADER = header(width=640, height=480)


def test_a_calibration_becomes_a_message_and_is_read_from_it(path: Path):
    path.write_text(f"{ROS}plane_homography:\n  data: [1, 0, 0, 0, 1, 0, 0, 0.1, 1]\n")
    found = read_calibration(path)
    message = CameraInfo.from_bytes(found.message(HEADER).to_bytes())
    again = Calibration.of_message(message)
    assert (again.camera, again.p, again.plane) == (found.camera, found.p, found.plane)


def test_an_impossible_message_is_dropped_naming_its_field():
    camera = CameraModel(640, 480, (500.0, 0, 320, 0, 500, 240, 0, 0, 1))
    message = Calibration(camera).message(HEADER)
    for change, says in (
        ({"k": (0.0,) * 9}, "CameraInfo.k"),
        ({"plane": (0.0,) * 9}, "CameraInfo.plane"),
        ({"distortion_model": "x"}, "CameraInfo.distortion_model"),
        ({"d": (1.0,) * 7}, "CameraInfo.d"),
    ):
        with pytest.raises(PayloadError, match=says) as caught:
            Calibration.of_message(message.model_copy(update=change))
        assert caught.value.reason == "bad_calibration"


# The calibration of a picture that was scaled, cut out or mirrored.

BENT = CameraModel(
    640, 480, (500.0, 0, 310.5, 0, 480, 239.5, 0, 0, 1), "plumb_bob", (-0.28, 0.09, 0.0012, -0.0007)
)
WHOLE = Calibration(BENT, plane=Plane((1, 0, 2, 0, 1.5, 0, 0, 1e-3, 1)))


@pytest.mark.parametrize(
    ("moved", "place"),
    [
        # The centre of a pixel of the half size lies between those of four: x = 2 x' + 0.5.
        (WHOLE.scaled(320, 240), lambda x, y: (2 * x + 0.5, 2 * y + 0.5)),
        (WHOLE.cropped(40, 30, 200, 100), lambda x, y: (x + 40, y + 30)),
        (WHOLE.mirrored(sideways=True, upside_down=False), lambda x, y: (639 - x, y)),
        (WHOLE.mirrored(sideways=False, upside_down=True), lambda x, y: (x, 479 - y)),
        (WHOLE.mirrored(sideways=True, upside_down=True), lambda x, y: (639 - x, 479 - y)),
    ],
    ids=["scaled", "cropped", "sideways", "upside down", "both"],
)
def test_a_pixel_shows_the_same_point_of_the_plane_as_the_one_that_it_was(moved, place):
    for x, y in ((10.0, 20.0), (180.0, 90.0), (70.0, 60.0)):
        assert moved.view.position(x, y) == pytest.approx(WHOLE.view.position(*place(x, y)))


def test_scaled_scales_lens_and_projection_together():
    half = WHOLE.scaled(320, 240)
    assert half.camera.k[:6] == half.p[:3] + half.p[4:7] == (250, 0, 155, 0, 240, 119.5)
    assert (half.camera.width, half.camera.height) == (320, 240)
    assert half.r == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    assert WHOLE.p == (500, 0, 310.5, 0, 0, 480, 239.5, 0, 0, 0, 1, 0)
    assert WHOLE.scaled(640, 480) is WHOLE
    with pytest.raises(CalibrationFault, match=r"640x360.*640x480 of the .*same aspect ratio"):
        WHOLE.scaled(640, 360)


def test_mirrored_axes_mirror_rectification_and_projection():
    """R keeps what is right and down; P has the picture's centre and the baseline mirrored."""
    r, p = tuple(map(float, range(1, 10))), (5.0, 0, 300, -7, 0, 5, 200, 3, 0, 0, 1, 0)
    turned = Calibration(BENT, r=r, p=p).mirrored(sideways=True, upside_down=False)
    assert turned.r == (1, -2, -3, -4, 5, 6, -7, 8, 9)
    assert turned.p == (5, 0, 639 - 300, 7, 0, 5, 200, 3, 0, 0, 1, 0)
    assert turned.camera.k == (500, 0, 639 - 310.5, 0, 480, 239.5, 0, 0, 1)
