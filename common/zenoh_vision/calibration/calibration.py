"""The calibration of one camera: its lens, and the plane in the world that it shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

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
            CalibrationFault: The other size has another aspect ratio.
        """
        camera = self.camera.scaled(width, height)
        if camera is self.camera:
            return self
        across, down = width / self.camera.width, height / self.camera.height
        p = list(self.p)
        p[:4] = [p[0] * across, p[1] * across, (p[2] + 0.5) * across - 0.5, p[3] * across]
        p[4:8] = [p[4] * down, p[5] * down, (p[6] + 0.5) * down - 0.5, p[7] * down]
        plane = None if self.plane is None else self.plane.scaled(across, down)
        return replace(self, camera=camera, p=tuple(p), plane=plane)

    def cropped(self, x: int, y: int, width: int, height: int) -> Calibration:
        """Return the calibration of a rectangle of the picture."""
        camera = self.camera.cropped(x, y, width, height)
        a, b, c = np.reshape(self.p, (3, 4))
        p = np.concatenate([a - x * c, b - y * c, c])
        plane = None if self.plane is None else self.plane.cropped(x, y)
        return replace(self, camera=camera, p=tuple(p.tolist()), plane=plane)

    def mirrored(self, *, sideways: bool, upside_down: bool) -> Calibration:
        """Return the calibration of the mirrored picture."""
        if not (sideways or upside_down):
            return self
        camera = self.camera.mirrored(sideways=sideways, upside_down=upside_down)
        across, down = -1.0 if sideways else 1.0, -1.0 if upside_down else 1.0
        p = list(self.p)
        p[1:4] = [
            p[1] * across * down,
            self.camera.width - 1 - p[2] if sideways else p[2],
            p[3] * across,
        ]
        p[6:8] = [self.camera.height - 1 - p[6] if upside_down else p[6], p[7] * down]
        signs = (1, across * down, across, across * down, 1, down, across, down, 1)
        r = tuple(number * sign for number, sign in zip(self.r, signs, strict=True))
        plane = self.plane
        if plane is not None:
            plane = plane.mirrored(
                self.camera.width, self.camera.height, sideways=sideways, upside_down=upside_down
            )
        return replace(self, camera=camera, r=r, p=tuple(p), plane=plane)

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
