"""Maps pixels of a camera to positions on a plane, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.camera_model import CameraModel, Points
from zenoh_vision.calibration.plane import Plane

STEP_PX: Final = 0.5
"""Step of the finite differences for the Jacobian: small against the curvature of a lens."""

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
        """Whether the picture shows the plane mirrored, if X is drawn to the right and Y up.

        A lens does not mirror, so this is the sign of the homography's determinant.
        """
        return bool(np.linalg.slogdet(self.plane.matrix).sign < 0)

    def positions(self, points: Points) -> Points:
        """Map pixels, (n, 2), to X, Y; NaN for a pixel that shows no point of the plane."""
        return self.plane.world(self.camera.undistorted(points))

    def position(self, x: float, y: float) -> tuple[float, float] | None:
        """Map one pixel to X, Y; None if it shows no point of the plane."""
        return pair(self.positions(np.array([[x, y]], np.float64))[0])

    def pixels(self, world: Points) -> Points:
        """Map points X, Y on the plane, (n, 2), to pixels of the picture."""
        return self.camera.distorted(self.plane.pixels(world))

    def jacobian(self, x: float, y: float) -> NDArray[np.float64] | None:
        """Return the derivatives of X, Y by the pixel's x, y.

        Returns:
            (2, 2), world units per pixel; None if a pixel beside it shows no point of the plane.
        """
        around = self.positions(AROUND + np.array([x, y]))
        if not np.isfinite(around).all():
            return None
        columns = (around[1] - around[2], around[3] - around[4])
        return np.stack(columns, axis=1) / (2 * STEP_PX)


def pair(numbers: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return two numbers as a tuple; None if one is not finite."""
    first, second = map(float, numbers)
    return (first, second) if np.isfinite(numbers).all() else None
