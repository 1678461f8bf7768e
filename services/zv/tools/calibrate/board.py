"""Finds a chessboard or ChArUco board in a picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.camera_model import Points

Kind = Literal["chessboard", "charuco"]
Gray = NDArray[np.uint8]

DICTIONARIES: Final = tuple(
    sorted(
        name.removeprefix("DICT_")
        for name in dir(cv2.aruco)
        if name.startswith("DICT_") and name == name.upper()
    )
)
"""The names of OpenCV's dictionaries of markers: ``4X4_50``."""

LEAST_CORNERS: Final = 8
"""Least number of corners of a ChArUco board, which may be partly hidden."""


@dataclass(frozen=True)
class BoardView:
    """A board in one picture.

    Attributes:
        points: (n, 2), its corners on the board, in the unit of its squares; the first inner
            corner is 0, 0, X along the rows of corners.
        pixels: (n, 2), where the picture shows them, distorted as it is.
        width: Width of the picture, pixels.
        height: Height of the picture, pixels.
    """

    points: Points
    pixels: Points
    width: int
    height: int


@dataclass(frozen=True)
class Board:
    """A calibration board.

    Args:
        kind: ``chessboard``, or ``charuco``: a chessboard with a marker in each white square.
        columns: Inner corners in a row of a chessboard; squares in a row of a ChArUco board.
        rows: Inner corners, or squares, in a column.
        square: Side of a square, in any unit.
        marker: Side of a marker, in that unit.
        dictionary: Name of the markers' dictionary.

    Sources: A. Duda and U. Frese, "Accurate detection and localization of checkerboard corners for
    calibration", 2018 (OpenCV's findChessboardCornersSB); S. Garrido-Jurado et al., "Automatic
    generation and detection of highly reliable fiducial markers under occlusion", 2014.
    """

    kind: Kind
    columns: int
    rows: int
    square: float
    marker: float = 0.0
    dictionary: str = "4X4_50"

    def find(self, gray: Gray) -> BoardView | None:
        """Return the board in a picture, (height, width); None if it is not found.

        A chessboard must be seen as a whole. Of a ChArUco board at least eight corners must be
        seen, of which two or more are not on a line with the others.
        """
        found = self._charuco(gray) if self.kind == "charuco" else self._chessboard(gray)
        if found is None:
            return None
        height, width = gray.shape
        return BoardView(*found, width, height)

    def _chessboard(self, gray: Gray) -> tuple[Points, Points] | None:
        size = (self.columns, self.rows)
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        seen, corners = cv2.findChessboardCornersSB(gray, size, flags=flags)
        if not seen:
            return None
        across, down = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        grid = np.stack([across.ravel(), down.ravel()], axis=1) * self.square
        return grid.astype(np.float64), np.asarray(corners, np.float64).reshape(-1, 2)

    def _charuco(self, gray: Gray) -> tuple[Points, Points] | None:
        found = [detector.detectBoard(gray)[:2] for detector in self._detectors]
        corners, ids = max(found, key=lambda each: 0 if each[1] is None else len(each[1]))
        if ids is None or len(ids) < LEAST_CORNERS:
            return None
        chosen = np.asarray(ids).ravel()
        # OpenCV's origin is the outer corner of the board, ours is the first inner corner.
        points = self.drawing.getChessboardCorners()[chosen, :2] - self.square
        points = np.asarray(points, np.float64)
        if _on_a_line(points):
            return None
        return points, np.asarray(corners, np.float64).reshape(-1, 2)

    @property
    def drawing(self) -> Any:
        """OpenCV's ChArUco board, which draws it too."""
        return self._drawings[0]

    @cached_property
    def _drawings(self) -> list[Any]:
        """The board as OpenCV draws it, and as it did before 4.6.

        With an even number of rows the older one has its markers in the other squares; calib.io
        and boards that were printed then have it.
        """
        number = getattr(cv2.aruco, f"DICT_{self.dictionary}")
        dictionary = cv2.aruco.getPredefinedDictionary(number)
        size = (self.columns, self.rows)
        drawings = [cv2.aruco.CharucoBoard(size, self.square, self.marker, dictionary)]
        if self.rows % 2 == 0:
            drawings.append(cv2.aruco.CharucoBoard(size, self.square, self.marker, dictionary))
            drawings[1].setLegacyPattern(True)
        return drawings

    @cached_property
    def _detectors(self) -> list[Any]:
        return [cv2.aruco.CharucoDetector(drawing) for drawing in self._drawings]


def _on_a_line(points: Points) -> bool:
    """Tell whether all points, or all but one, are on a line; these do not determine a lens.

    Args:
        points: (n, 2), corners of a grid.
    """
    for left_out in range(len(points)):
        others = np.delete(points, left_out, axis=0)
        across, along = np.linalg.svd(others - others.mean(axis=0), compute_uv=False)[::-1]
        if across <= 1e-6 * along:
            return True
    return False
