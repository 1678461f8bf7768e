"""``zv calibrate camera`` and ``zv calibrate plane``: what is written, said and refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.pictures.boards import poses_of, seen
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.calibration.ros_yaml import read_calibration, write_calibration
from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError, VisionError
from zenoh_vision.transport.connection import Connection
from zv.tools.calibrate import camera, plane
from zv.tools.calibrate.board import Board
from zv.tools.calibrate.options import CameraOptions, PlaneOptions
from zv.tools.shared.output import Output

SIZE = (480, 360)
K = np.array([[320.0, 0, 246], [0, 316, 174], [0, 0, 1]])
D = (-0.25, 0.08, 0.001, -0.0008, 0.0)
BOARD = Board("charuco", 9, 6, 30.0, 22.5)
DESCRIBED = {"board": "charuco", "size": "9x6", "square": 30.0}
NOWHERE = Connection("tcp/127.0.0.1:1", timeout_s=0.1)
LENS = CameraModel(*SIZE, tuple(K.ravel().tolist()), "plumb_bob", D)

Run = Callable[..., dict[str, Any]]


@pytest.fixture
def front(tmp_path: Path) -> Path:
    """The calibration file of a lens."""
    path = tmp_path / "front.yaml"
    write_calibration(Calibration(LENS, "front"), path)
    return path


@pytest.fixture
def calibrate(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command; return its JSON, with what it said under ``said``."""

    def run(command: str, **options: Any) -> dict[str, Any]:
        model, tool = {"camera": (CameraOptions, camera), "plane": (PlaneOptions, plane)}[command]
        tool.run(load_settings(model, flags=options), NOWHERE, Output(as_json=True))
        out, err = capsys.readouterr()
        return json.loads(out) | {"said": err}

    return run


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of pictures of the board, and two files that show none."""
    folder = tmp_path_factory.mktemp("boards")
    for number, pose in enumerate(poses_of(BOARD)):
        cv2.imwrite(str(folder / f"{number}.png"), seen(BOARD, K, D, SIZE, *pose))
    cv2.imwrite(str(folder / "empty.png"), np.zeros((360, 480), np.uint8))
    (folder / "broken.jpg").write_bytes(b"\xff\xd8\xff broken")
    (folder / "notes.txt").write_text("not a picture")
    return folder


def test_camera_finds_the_lens_and_writes_the_file_of_ros(
    calibrate: Run, boards: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("zv.tools.calibrate.coverage.LEAST_SHARE", 0.12)
    monkeypatch.chdir(tmp_path)
    found = calibrate("camera", images=str(boards), camera="bay_1", **DESCRIBED)
    assert (found["file"], found["pictures"]) == ("bay_1.yaml", 10)
    assert found["rms_px"] < 0.5
    written = read_calibration(tmp_path / "bay_1.yaml")
    assert written.name == "bay_1"
    assert written.camera.k[0] == pytest.approx(320, rel=0.01)
    said = found["said"].splitlines()
    assert len(said) == 12
    assert "corners, middle, " in said[0]
    assert "missing: 7 more pictures that differ; " in said[0]
    assert said[9].endswith("; complete")
    assert "broken.jpg: " in said[10]
    assert said[11].endswith("empty.png: no board found")


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"dictionary": "6X6_50"}, ExpectationNotMet, "no charuco of 9x6 found in 11 pictures"),
        ({"max_error": 0.01}, ExpectationNotMet, "reprojection error is .* at most 0.01"),
        ({"images": "nowhere"}, SourceError, "nowhere: No such file"),
        ({"size": None}, ConfigurationError, "--size COLUMNSxROWS and --square"),
        ({"size": "9by6"}, ConfigurationError, "COLUMNSxROWS, such as 9x6"),
        ({"size": "2x9"}, ConfigurationError, "3x3 and more"),
        ({"square": 0}, ConfigurationError, "--square .*above 0"),
        ({"marker": 30.0}, ConfigurationError, "marker 30 is not below square 30"),
        ({"dictionary": "4X4"}, ConfigurationError, "--dictionary .*4X4_50"),
        ({"model": "pinhole"}, ConfigurationError, "--model .*plumb_bob"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_camera_refuses_and_writes_nothing(
    calibrate: Run,
    boards: Path,
    tmp_path: Path,
    options: dict[str, Any],
    error: type[VisionError],
    says: str,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("zv.tools.calibrate.coverage.LEAST_SHARE", 0.12)
    file = tmp_path / "x.yaml"
    given = {"images": str(boards), "output": str(file), **DESCRIBED} | options
    with pytest.raises(error, match=says):
        calibrate("camera", **given)
    assert not file.exists()


def test_camera_says_what_a_poor_set_lacks(calibrate: Run, boards: Path, tmp_path: Path):
    for number in (0, 1):
        (tmp_path / f"{number}.png").write_bytes((boards / f"{number}.png").read_bytes())
        (tmp_path / f"{number}b.png").write_bytes((boards / f"{number}.png").read_bytes())
    with pytest.raises(ExpectationNotMet, match="2 pictures are not enough; missing: 6 more"):
        calibrate("camera", images=str(tmp_path), **DESCRIBED)


def test_plane_from_pairs_removes_the_distortion_first(calibrate: Run, front: Path):
    truth = Plane((0.004, 0, 0, 0, 0.005, 0, 0, 0.0008, 1))
    pixels = np.array([(20, 30), (460, 40), (440, 330), (30, 320), (240, 180)], float)
    world = truth.world(LENS.undistorted(pixels))
    texts = [f"{x:g},{y:g}={u:.9f},{v:.9f}" for (x, y), (u, v) in zip(pixels, world, strict=True)]
    found = calibrate("plane", calibration=str(front), pair=tuple(texts))
    assert found["rms"] < 1e-6
    view = read_calibration(front).view
    assert view is not None
    inside = np.array([(100.0, 250.0), (400.0, 90.0)])
    expected = truth.world(LENS.undistorted(inside))
    np.testing.assert_allclose(view.positions(inside), expected, rtol=1e-5)
    assert read_calibration(front).camera == LENS


def test_plane_from_a_file_of_pairs_with_comments(calibrate: Run, front: Path, tmp_path: Path):
    pairs = tmp_path / "belt.txt"
    pairs.write_text("# belt\n0,0=0,0\n479,0=1,0  # far corner\n\n479,359=1,1\n0, 359 = 0, 1\n")
    other = tmp_path / "with_plane.yaml"
    before = front.read_text()
    found = calibrate("plane", calibration=str(front), pairs=str(pairs), output=str(other))
    assert (found["pairs"], found["file"]) == (4, str(other))
    assert front.read_text() == before
    assert 0 < found["per_pixel"] < 0.1
    assert read_calibration(other).plane is not None


def test_plane_without_a_lens_writes_a_new_file(calibrate: Run, tmp_path: Path):
    file = tmp_path / "new.yaml"
    texts = ("0,0=0,0", "100,0=1,0", "100,100=1,1", "0,100=0,1")
    calibrate("plane", calibration=str(file), pair=texts, no_lens="320x240", camera="top")
    found = read_calibration(file)
    assert (found.camera.width, found.camera.d, found.name) == (320, (), "top")
    assert found.view is not None
    assert found.view.position(50, 25) == pytest.approx((0.5, 0.25))
    with pytest.raises(ConfigurationError, match=r"new\.yaml exists, and --no-lens"):
        calibrate("plane", calibration=str(file), pair=texts, no_lens="320x240")


def test_plane_from_a_board_on_it_has_the_boards_unit_and_origin(
    calibrate: Run, boards: Path, front: Path
):
    found = calibrate("plane", calibration=str(front), image=str(boards / "1.png"), **DESCRIBED)
    assert found["pairs"] > 30
    assert found["rms"] < 1  # mm
    turn, move = poses_of(BOARD)[1]
    corners = np.array([(0.0, 0, 0), (210, 0, 0), (90, 120, 0)])
    pixels, _ = cv2.projectPoints(corners, turn, move, K, np.array(D))
    view = read_calibration(front).view
    assert view is not None
    np.testing.assert_allclose(view.positions(pixels.reshape(-1, 2)), corners[:, :2], atol=2)
    words = r"near (\d+),(\d+), is the origin; X runs towards (\d+),(\d+), Y towards (\d+),(\d+)\n"
    said = re.search(words, found["said"])
    assert said is not None
    ends = np.array([float(number) for number in said.groups()]).reshape(3, 2)
    # The corners at the ends of the first row and the first column; to a whole pixel, as it says.
    np.testing.assert_allclose(view.positions(ends), [(0, 0), (210, 0), (0, 120)], atol=3)


FOUR = ("0,0=0,0", "100,0=1,0", "100,100=1,1", "0,100=0,1")


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"pair": FOUR[:3]}, ExpectationNotMet, "3 pairs do not determine a plane"),
        ({"pair": ("0,0=0,0", "1,1=1,1", "2,2=2,2", "9,9=9,9")}, ExpectationNotMet, "on a line"),
        (
            {"pair": (*FOUR, "50,50=0.9,0.1"), "max_error": 0.01},
            ExpectationNotMet,
            "the error is .* at most 0.01 is allowed",
        ),
        ({"pair": ("1,2,3,4",)}, ConfigurationError, r"--pair .*x,y=X,Y"),
        ({"pair": ("1,2=nan,4",)}, ConfigurationError, r"--pair .*x,y=X,Y"),
        ({}, ConfigurationError, "no pairs given; allowed: one of --pair, --pairs, a board"),
        ({"pair": FOUR, "pairs": "x"}, ConfigurationError, "--pair and --pairs given"),
        ({"pairs": "nowhere.txt"}, SourceError, r"nowhere\.txt: No such file"),
        (
            {"pair": (*FOUR[:3], "1e9,0=1,2")},
            ConfigurationError,
            "outside of the picture; allowed: 0,0 to",
        ),
        ({"image": "empty.png"}, ConfigurationError, "--size COLUMNSxROWS"),
        ({"image": "empty.png", **DESCRIBED}, ExpectationNotMet, "no charuco of 9x6 found in"),
        ({"image": "notes.txt", **DESCRIBED}, SourceError, "not an image"),
    ],
)
def test_plane_refuses_and_leaves_the_file_as_it_is(
    calibrate: Run,
    boards: Path,
    front: Path,
    options: dict[str, Any],
    error: type[VisionError],
    says: str,
):
    before = front.read_text()
    if "image" in options:
        options = options | {"image": str(boards / options["image"])}
    with pytest.raises(error, match=says):
        calibrate("plane", calibration=str(front), **options)
    assert front.read_text() == before


def test_a_line_that_is_no_pair_is_named(calibrate: Run, front: Path, tmp_path: Path):
    pairs = tmp_path / "belt.txt"
    pairs.write_text("0,0=0,0\n1;2=3,4\n")
    with pytest.raises(ConfigurationError, match=r"belt\.txt: line 2: '1;2=3,4'; allowed: x,y"):
        calibrate("plane", calibration=str(front), pairs=str(pairs))


def test_a_board_in_a_picture_of_another_shape_is_refused(
    calibrate: Run, boards: Path, front: Path
):
    wide = Calibration(CameraModel(640, 360, tuple(K.ravel().tolist())))
    write_calibration(wide, front)
    with pytest.raises(ConfigurationError, match="480x360; allowed: 640x360 of the calibration"):
        calibrate("plane", calibration=str(front), image=str(boards / "1.png"), **DESCRIBED)
