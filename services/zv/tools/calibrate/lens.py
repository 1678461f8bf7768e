"""Finds a camera's lens from views of a board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel, DistortionModel
from zv.tools.calibrate.board import BoardView

FLAGS: Final[dict[DistortionModel, int]] = {
    "plumb_bob": 0,
    "rational_polynomial": cv2.CALIB_RATIONAL_MODEL,
}

COUNT: Final[dict[DistortionModel, int]] = {"plumb_bob": 5, "rational_polynomial": 8}


class PoorViews(ValueError):
    """Views from which no lens can be found."""


@dataclass(frozen=True)
class LensFit:
    """A lens that was found, and how well it fits the views.

    Attributes:
        camera: The lens.
        rms: Root mean square of the distances between the corners and where the lens puts them,
            pixels.
        errors: ``rms`` of each view alone, (n,).
        focal_sigma: Standard deviation of the focal length, as a share of it; None if the method
            does not give it.
    """

    camera: CameraModel
    rms: float
    errors: NDArray[np.float64]
    focal_sigma: float | None


def fit_lens(views: Sequence[BoardView], model: DistortionModel) -> LensFit:
    """Find the lens that fits the observed corners of the boards best, by least squares.

    Source: Z. Zhang, "A flexible new technique for camera calibration", 2000, as in OpenCV; for
    ``equidistant`` that of OpenCV's fisheye module.

    Args:
        views: Of one size of picture, at least three.
        model: Name of the distortion model.

    Raises:
        PoorViews: The views do not determine it.
    """
    size = (views[0].width, views[0].height)
    boards = [np.concatenate([v.points, np.zeros((len(v.points), 1))], axis=1) for v in views]
    shown = [view.pixels for view in views]
    try:
        found = _fisheye if model == "equidistant" else _pinhole
        rms, matrix, coefficients, errors, sigma = found(boards, shown, size, model)
        k = (matrix[0, 0], 0.0, matrix[0, 2], 0.0, matrix[1, 1], matrix[1, 2], 0.0, 0.0, 1.0)
        d = tuple(map(float, np.ravel(coefficients)))
        camera = CameraModel(*size, tuple(map(float, k)), model, d)
    except (cv2.error, CalibrationFault) as error:
        words = str(getattr(error, "err", error)).strip()
        raise PoorViews(f"the views do not determine the lens ({words})") from None
    return LensFit(camera, float(rms), np.ravel(errors), sigma)


Found = tuple[float, Any, Any, Any, float | None]


def _pinhole(boards: Any, shown: Any, size: tuple[int, int], model: DistortionModel) -> Found:
    rms, matrix, coefficients, _, _, sigmas, _, errors = cv2.calibrateCameraExtended(
        [board.astype(np.float32) for board in boards],
        [pixels.astype(np.float32) for pixels in shown],
        size,
        np.eye(3),
        np.zeros(COUNT[model]),
        flags=FLAGS[model],
    )
    sigma = float(np.max(np.ravel(sigmas)[:2] / (matrix[0, 0], matrix[1, 1])))
    return rms, matrix, np.ravel(coefficients)[: COUNT[model]], errors, sigma


def _fisheye(boards: Any, shown: Any, size: tuple[int, int], _model: DistortionModel) -> Found:
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    rms, matrix, coefficients, turns, moves = cv2.fisheye.calibrate(
        [board.reshape(1, -1, 3) for board in boards],
        [pixels.reshape(1, -1, 2) for pixels in shown],
        size,
        np.eye(3),
        np.zeros((4, 1)),
        flags=flags,
    )
    errors = []
    for board, pixels, turn, move in zip(boards, shown, turns, moves, strict=True):
        again, _ = cv2.fisheye.projectPoints(
            board.reshape(-1, 1, 3), turn, move, matrix, coefficients
        )
        off = again.reshape(-1, 2) - pixels
        errors.append(np.sqrt((off**2).sum(axis=1).mean()))
    return rms, matrix, coefficients, np.array(errors), None
