"""``zv calibrate`` from a camera's stream."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.pictures.boards import poses_of, seen
from tests.support.processes import START_S
from zenoh_vision.calibration.ros_yaml import read_calibration
from zenoh_vision.errors import ExpectationNotMet
from zv.tools.calibrate import camera, pictures, plane
from zv.tools.calibrate.board import Board
from zv.tools.calibrate.options import CameraOptions, PlaneOptions
from zv.tools.shared.output import Output

BOARD = Board("chessboard", 8, 5, 30.0)
DESCRIBED = {"size": "8x5", "square": 30.0}
K = np.array([[160.0, 0, 123], [0, 158, 87], [0, 0, 1]])
SIZE = (240, 180)  # a board is found in a quarter of the time that 480x360 takes


def test_lens_and_plane_are_found_from_a_stream(
    connection, service, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
):
    boards = tmp_path / "boards"
    boards.mkdir()
    for number, pose in enumerate(poses_of(BOARD)):
        picture = seen(BOARD, K, (-0.2, 0.05, 0.0, 0.0, 0.0), SIZE, *pose)
        for still in range(2):  # the board is held still
            cv2.imwrite(str(boards / f"{number}_{still}.png"), picture)
    service("camera", "--source", boards, "--rate", 5, "--loop")
    monkeypatch.setattr(pictures, "SILENT_S", START_S)
    output = Output(as_json=True)
    file = tmp_path / "front.yaml"
    camera.run(CameraOptions(output=str(file), for_=60, **DESCRIBED), connection, output)
    out, err = capsys.readouterr()
    assert json.loads(out)["rms_px"] < 0.5
    assert "complete" in err.splitlines()[-1]
    assert "hold it still" in err
    plane.run(PlaneOptions(calibration=str(file), **DESCRIBED), connection, output)
    assert json.loads(capsys.readouterr().out)["pairs"] == 40
    assert read_calibration(file).plane is not None


def test_a_camera_that_does_not_run_is_an_error(connection, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pictures, "SILENT_S", 0.3)
    with pytest.raises(ExpectationNotMet, match="no picture on vision/front/image/compressed"):
        camera.run(CameraOptions(**DESCRIBED), connection, Output())


def test_a_plane_without_a_board_names_the_pictures_that_were_searched(
    connection, monkeypatch: pytest.MonkeyPatch
):
    grey = np.full((180, 240), 128, np.uint8)
    monkeypatch.setattr(plane, "from_stream", lambda *_: iter([grey, grey]))
    options = PlaneOptions(calibration="new.yaml", no_lens="240x180", **DESCRIBED)
    with pytest.raises(ExpectationNotMet, match="no chessboard of 8x5 found in 2 pictures of f"):
        plane.run(options, connection, Output())
