"""A plane as a camera sees it: positions, velocities and their uncertainty, from pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.camera_model import CameraModel, Points
from zenoh_vision.calibration.plane import Plane

STEP_PX: Final = 0.5
"""Of the differences that give the Jacobian: small against the curvature of a lens."""

AROUND: Final = np.array([[0, 0], [STEP_PX, 0], [-STEP_PX, 0], [0, STEP_PX], [0, -STEP_PX]])


@dataclass(frozen=True)
class PlaneView:
    """Maps pixels of a picture, with the distortion of the lens, to X, Y on a plane.

    Args:
        camera: The lens; its distortion is removed first.
        plane: From the undistorted pixels to the world.
    """

    camera: CameraModel
    plane: Plane

    @property
    def mirrored(self) -> bool:
        """Whether right in the picture is left on the plane, drawn with X to the right and Y up.

        A lens does not mirror, so this is the sign of the homography's determinant.
        """
        return bool(np.linalg.slogdet(self.plane.matrix).sign < 0)

    def positions(self, points: Points) -> Points:
        """Return X, Y of pixels, (n, 2); NaN for a pixel that shows no point of the plane."""
        return self.plane.world(self.camera.undistorted(points))

    def position(self, x: float, y: float) -> tuple[float, float] | None:
        """Return X, Y of one pixel; None if it shows no point of the plane."""
        return pair(self.positions(np.array([[x, y]], np.float64))[0])

    def pixels(self, world: Points) -> Points:
        """Return where the picture shows points X, Y on the plane, (n, 2)."""
        return self.camera.distorted(self.plane.pixels(world))

    def jacobian(self, x: float, y: float) -> NDArray[np.float64] | None:
        """Return how X, Y change with the pixel, (2, 2), world units per pixel; None if unknown."""
        around = self.positions(AROUND + np.array([x, y]))
        if not np.isfinite(around).all():
            return None
        columns = (around[1] - around[2], around[3] - around[4])
        return np.stack(columns, axis=1) / (2 * STEP_PX)

    def velocity(self, x: float, y: float, vx: float, vy: float) -> tuple[float, float] | None:
        """Return the velocity on the plane of a point that moves at vx, vy pixels per second.

        Returns:
            World units per second; None if the pixel shows no point of the plane.
        """
        jacobian = self.jacobian(x, y)
        return None if jacobian is None else pair(jacobian @ (vx, vy))

    def covariance(
        self, x: float, y: float, covariance: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return the covariance on the plane of a position with a covariance in pixels.

        It is propagated to first order: J C J'.

        Args:
            x: The position, pixels; so is ``y``.
            y: As x.
            covariance: (2, 2), square pixels.

        Returns:
            (2, 2), square world units; None if the pixel shows no point of the plane.
        """
        jacobian = self.jacobian(x, y)
        return None if jacobian is None else np.asarray(jacobian @ covariance @ jacobian.T)


def pair(numbers: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return two numbers as a tuple; None if one is not finite."""
    first, second = map(float, numbers)
    return (first, second) if np.isfinite(numbers).all() else None
