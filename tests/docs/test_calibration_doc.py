"""docs/calibration.md is true: its commands run as written, one after the other."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from tests.support.pictures.boards import poses_of, seen
from tests.support.viewer.pages import Page, run_as_written
from zenoh_vision.calibration.ros_yaml import read_calibration
from zv.tools.calibrate import coverage
from zv.tools.calibrate.board import Board

PAGE = Page("docs/calibration.md")
BOARD = Board("chessboard", 8, 5, 30.0)
K = np.array([[320.0, 0, 246], [0, 316, 174], [0, 0, 1]])


def test_the_commands_run_as_written_and_the_plane_is_in_the_file(tmp_path: Path):
    (tmp_path / "boards").mkdir()
    for number, pose in enumerate(poses_of(BOARD)):
        picture = seen(BOARD, K, (-0.2, 0.05, 0.0, 0.0, 0.0), (480, 360), *pose)
        cv2.imwrite(str(tmp_path / "boards" / f"{number}.png"), picture)
    (pairs,) = PAGE.blocks("text")
    (tmp_path / "belt.txt").write_text(pairs)
    said = []
    for command in PAGE.commands():
        done = run_as_written(command, tmp_path)
        assert done.returncode == 0, (command, done.stderr)
        said.append(done.stdout)
    assert "reprojection error 0." in said[0]
    assert "front.yaml: plane of 5 pairs" in said[1]
    assert read_calibration(tmp_path / "front.yaml").plane is not None


def test_what_is_required_is_as_the_page_says():
    assert f"- {coverage.LEAST_VIEWS} pictures that differ" in PAGE.text
    assert f"by {coverage.LEAST_TILT_DEG:g} degrees or more" in PAGE.text
    assert f"over {coverage.LEAST_SHARE:.0%}".replace("%", " %") in PAGE.text
    assert coverage.TILTED_VIEWS == 2
