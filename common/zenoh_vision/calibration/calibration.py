"""The calibration of one camera: its lens, and the plane in the world that it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.camera_model import (
    CalibrationFault,
    CameraModel,
    checked_numbers,
    model_named,
)
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import CameraInfo, Header

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Calibration:
    """A camera's calibration, with the fields of sensor_msgs/CameraInfo.

    Args:
        camera: The lens, for the size of picture at which it was calibrated.
        name: Name of the camera.
        r: The rectification matrix, row by row; the identity except for stereo cameras.
        p: The projection matrix, row by row; empty for the camera matrix with a column of zeros.
        plane: Homography from undistorted pixels to the world; None without one.

    Raises:
        CalibrationFault: A value is invalid.
    """

    camera: CameraModel
    name: str = "camera"
    r: tuple[float, ...] = IDENTITY
    p: tuple[float, ...] = ()
    plane: Plane | None = None

    def __post_init__(self) -> None:
        checked_numbers("r", self.r, 9)
        if not self.p:
            a, b, c, d, e, f, *_ = self.camera.k
            object.__setattr__(self, "p", (a, b, c, 0.0, d, e, f, 0.0, 0.0, 0.0, 1.0, 0.0))
        checked_numbers("p", self.p, 12)

    @property
    def view(self) -> PlaneView | None:
        """The mapping from pixels to the world; None without a plane."""
        return None if self.plane is None else PlaneView(self.camera, self.plane)

    def scaled(self, width: int, height: int) -> Calibration:
        """Return the calibration of the same picture at another size with the same aspect ratio.

        Raises:
            CalibrationFault: The aspect ratio differs by more than a pixel, so the picture shows
                another part of the scene.
        """
        was = self.camera
        if (width, height) == (was.width, was.height):
            return self
        across, down = width / was.width, height / was.height
        if abs(height - was.height * across) > 1 and abs(width - was.width * down) > 1:
            raise CalibrationFault(
                "picture",
                f"{width}x{height}",
                f"{was.width}x{was.height} of the calibration, or the same aspect ratio",
            )
        # A pixel's centre is at a whole number, so its left edge is at -0.5.
        shift_x, shift_y = 0.5 * across - 0.5, 0.5 * down - 0.5
        return self._moved([[across, 0, shift_x], [0, down, shift_y], [0, 0, 1]], width, height)

    def cropped(self, x: int, y: int, width: int, height: int) -> Calibration:
        """Return the calibration of a rectangle of the picture."""
        return self._moved([[1, 0, -x], [0, 1, -y], [0, 0, 1]], width, height)

    def mirrored(self, *, sideways: bool, upside_down: bool) -> Calibration:
        """Return the calibration of the mirrored picture."""
        if not (sideways or upside_down):
            return self
        width, height = self.camera.width, self.camera.height
        across = [-1, 0, width - 1] if sideways else [1, 0, 0]
        down = [0, -1, height - 1] if upside_down else [0, 1, 0]
        return self._moved([across, down, [0, 0, 1]], width, height)

    def rotated(self, degrees: int) -> Calibration:
        """Return the calibration of the picture rotated clockwise by 0, 90, 180 or 270 degrees."""
        width, height = self.camera.width, self.camera.height
        if degrees == 90:
            return self._moved([[0, -1, height - 1], [1, 0, 0], [0, 0, 1]], height, width)
        if degrees == 270:
            return self._moved([[0, 1, 0], [-1, 0, width - 1], [0, 0, 1]], height, width)
        return self.mirrored(sideways=degrees == 180, upside_down=degrees == 180)

    def _moved(self, rows: Sequence[Sequence[float]], width: int, height: int) -> Calibration:
        """Return the calibration of a picture with other pixel coordinates.

        Args:
            rows: The matrix from this picture's coordinates to those of the other, (3, 3). If it
                mirrors them or turns them by a right angle, the axes of the camera do so too, so
                that focal lengths stay above 0 and on the diagonal.
            width: Of the other picture, pixels.
            height: The same.
        """
        move = np.array(rows, np.float64)
        axes = np.eye(3)
        axes[:2, :2] = np.sign(move[:2, :2])
        d = list(self.camera.d)
        if d and self.camera.distortion_model != "equidistant":
            # The tangential distortion p1, p2: (p2, p1) is a vector of the picture's plane.
            d[3], d[2] = map(float, axes[:2, :2] @ (d[3], d[2]))
        k = move @ self.camera.matrix @ axes.T
        p = move @ np.reshape(self.p, (3, 4))
        p[:, :3] = p[:, :3] @ axes.T
        return replace(
            self,
            camera=replace(self.camera, width=width, height=height, k=_row_by_row(k), d=tuple(d)),
            r=_row_by_row(axes @ np.reshape(self.r, (3, 3)) @ axes.T),
            p=_row_by_row(p),
            plane=self.plane
            and Plane(_row_by_row(self.plane.matrix @ np.linalg.inv(move).astype(np.float64))),
        )

    def message(self, header: Header) -> CameraInfo:
        """Return the calibration as a ``CameraInfo`` message with the header of a frame."""
        return CameraInfo(
            header=header,
            width=self.camera.width,
            height=self.camera.height,
            distortion_model=self.camera.distortion_model,
            d=self.camera.d,
            k=self.camera.k,
            r=self.r,
            p=self.p,
            plane=None if self.plane is None else self.plane.h,
        )

    @classmethod
    def of_message(cls, message: CameraInfo) -> Calibration:
        """Return the calibration that a message contains.

        Raises:
            PayloadError: ``bad_calibration``: a value is invalid; the text names it.
        """
        try:
            camera = CameraModel(
                message.width,
                message.height,
                message.k,
                model_named(message.distortion_model),
                message.d,
            )
            plane = None if message.plane is None else Plane(message.plane)
            return cls(camera, message.header.camera, message.r, message.p, plane)
        except CalibrationFault as fault:
            raise PayloadError("bad_calibration", f"CameraInfo.{fault}") from None


def _row_by_row(matrix: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple((matrix + 0.0).ravel().tolist())  # -0.0 becomes 0.0
