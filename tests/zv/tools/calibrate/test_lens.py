"""A known lens is found again from pictures of a board that it is made to see."""

from __future__ import annotations

import struct
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.pictures.boards import SQUARE_PIXELS, flat, poses_of, seen
from zenoh_vision.calibration.camera_model import CameraModel, DistortionModel
from zv.tools.calibrate.board import Board, BoardView, _on_a_line
from zv.tools.calibrate.coverage import missing, pose_of
from zv.tools.calibrate.lens import PoorViews, fit_lens
from zv.tools.calibrate.pictures import read_gray

SIZE = (480, 360)
K = np.array([[320.0, 0, 246], [0, 316, 174], [0, 0, 1]])
LENSES: dict[DistortionModel, tuple[float, ...]] = {
    "plumb_bob": (-0.25, 0.08, 0.001, -0.0008, 0.0),
    "equidistant": (-0.05, 0.02, -0.01, 0.002),
}
BOARDS = {
    "chessboard": Board("chessboard", 8, 5, 30.0),
    "charuco": Board("charuco", 9, 6, 30.0, 22.0),
}


@cache
def views(model: DistortionModel, kind: str) -> tuple[BoardView, ...]:
    board = BOARDS[kind]
    found = [
        board.find(seen(board, K, LENSES[model], SIZE, *pose, fisheye=model == "equidistant"))
        for pose in poses_of(board)
    ]
    return tuple(view for view in found if view is not None)


@pytest.mark.parametrize(
    ("model", "kind"),
    [("plumb_bob", "chessboard"), ("plumb_bob", "charuco"), ("equidistant", "chessboard")],
)
def test_the_lens_is_found_again(model: DistortionModel, kind: str):
    found = views(model, kind)
    assert missing([pose_of(view) for view in found]) == []
    fit = fit_lens(found, model)
    assert fit.rms < 0.4
    assert len(fit.errors) == len(found)
    assert fit.camera.k[0] == pytest.approx(320, rel=0.01)
    assert fit.camera.k[4] == pytest.approx(316, rel=0.01)
    assert (fit.camera.k[2], fit.camera.k[5]) == pytest.approx((246, 174), abs=2)
    # What counts is where the rays go: compared over the picture, in pixels. That all are turned
    # alike cannot be told from a board that is.
    truth = CameraModel(*SIZE, tuple(K.ravel().tolist()), model, LENSES[model])
    grid = np.array([(x, y) for x in range(40, 480, 80) for y in range(40, 360, 70)], float)
    rays = (truth.undistorted(grid) - K[:2, 2]) / np.diag(K)[:2]
    own = np.array(fit.camera.k).reshape(3, 3)
    again = fit.camera.distorted(rays * np.diag(own)[:2] + own[:2, 2])
    off = again - grid
    assert np.abs(off - off.mean(axis=0)).max() < 2.5


@pytest.mark.parametrize("kind", sorted(BOARDS))
def test_corners_are_found_where_they_are(kind: str):
    board = BOARDS[kind]
    turn, move = poses_of(board)[1]
    view = board.find(seen(board, K, LENSES["plumb_bob"], SIZE, turn, move))
    assert view is not None
    flat = np.concatenate([view.points, np.zeros((len(view.points), 1))], axis=1)
    truth, _ = cv2.projectPoints(flat, turn, move, K, np.array(LENSES["plumb_bob"]))
    off = np.abs(view.pixels - truth.reshape(-1, 2))
    turned = np.abs(view.pixels[::-1] - truth.reshape(-1, 2))  # half a turn looks the same
    assert min(np.quantile(off, 0.9), np.quantile(turned, 0.9)) < 0.25


def test_a_picture_without_a_board_has_none():
    gray = np.random.default_rng(1).integers(0, 255, (120, 160), np.uint8)
    assert [board.find(gray) for board in BOARDS.values()] == [None, None]


def test_views_that_are_all_alike_lack_parts_tilts_and_size():
    (first, *_) = views("plumb_bob", "chessboard")
    small = BoardView(first.points, first.pixels / 3, *SIZE)
    lacking = missing([pose_of(small)] * 3)
    assert lacking[0] == "5 more pictures that differ"
    assert "bottom right" in lacking[1]
    assert "turned to the left or right by 15 degrees" in lacking[2]
    assert "leaned forwards or backwards" in lacking[3]
    assert "nearer" in lacking[4]


def test_each_missing_thing_is_named_alone():
    poses = [pose_of(view) for view in views("plumb_bob", "chessboard")]
    straight = [pose for pose in poses if abs(pose.turned_deg) < 15]
    (_, turned) = missing(straight)
    assert turned.startswith("2 with the board turned")


def test_views_from_which_nothing_follows_are_refused():
    points = np.array([(x, y) for x in range(4) for y in range(4)], float)
    flat = BoardView(points, np.zeros((16, 2)), *SIZE)
    for model in LENSES:
        with pytest.raises(PoorViews):
            fit_lens([flat] * 4, model)


@pytest.mark.parametrize(("rows", "corners"), [(2, 0), (3, 16)], ids=["one row", "two rows"])
def test_corners_on_a_line_are_no_view(rows: int, corners: int):
    """So many rows of squares of a ChArUco board in the picture; 8 inner corners between two."""
    picture = flat(BOARDS["charuco"])[: (1 + rows) * SQUARE_PIXELS]
    view = BOARDS["charuco"].find(np.ascontiguousarray(picture))
    assert (0 if view is None else len(view.points)) == corners


def test_corners_on_a_line_but_one_are_no_view():
    row = [(30.0 * x, 0.0) for x in range(7)]
    assert _on_a_line(np.array([*row, (60.0, 30.0)]))
    assert not _on_a_line(np.array([*row, (60.0, 30.0), (90.0, 60.0)]))


def test_a_charuco_board_of_before_opencv_4_6_is_found():
    """With an even number of rows its markers are in the other squares; as calib.io prints it."""
    board = Board("charuco", 9, 6, 30.0, 22.0)
    older = Board("charuco", 9, 6, 30.0, 22.0)
    older.drawing.setLegacyPattern(True)  # draws the older board, and is not asked to find it
    turn, move = poses_of(board)[1]
    picture = seen(older, K, LENSES["plumb_bob"], SIZE, turn, move)
    assert not np.array_equal(flat(older), flat(board))
    view = Board("charuco", 9, 6, 30.0, 22.0).find(picture)
    assert view is not None
    on_board = np.concatenate([view.points, np.zeros((len(view.points), 1))], axis=1)
    truth, _ = cv2.projectPoints(on_board, turn, move, K, np.array(LENSES["plumb_bob"]))
    assert np.quantile(np.abs(view.pixels - truth.reshape(-1, 2)), 0.9) < 0.25


def test_how_a_photo_was_held_does_not_turn_the_lens(tmp_path: Path):
    """An Exif orientation is ignored: the pixels of a file are those of the sensor."""
    gray = np.zeros((40, 60), np.uint8)
    gray[:, :20] = 200
    jpeg = cv2.imencode(".jpg", gray)[1].tobytes()
    for orientation in (3, 6):
        tiff = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0" + bytes([orientation]) + b"\0" * 7
        exif = b"Exif\0\0" + tiff
        path = tmp_path / f"{orientation}.jpg"
        path.write_bytes(
            jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]
        )
        assert cv2.imread(str(path)).shape[:2] == ((60, 40) if orientation == 6 else (40, 60))
        found = read_gray(path)
        assert found.shape == (40, 60)
        assert found[:, 5].mean() > 150 > found[:, 50].mean()
