"""A camera's lens: converts between the pixels of its picture and those of an ideal lens."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""x, y of each point, (n, 2)."""

DistortionModel = Literal["plumb_bob", "rational_polynomial", "equidistant"]

COEFFICIENTS: Final[dict[DistortionModel, tuple[int, ...]]] = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (0, 8),
    "equidistant": (0, 4),
}
"""The allowed numbers of coefficients of each model, by the model's name in ROS; 0 coefficients
mean no distortion."""

ALIASES: Final[dict[str, DistortionModel]] = {"fisheye": "equidistant", "": "plumb_bob"}
"""Other names for models: ROS' calibrator wrote ``fisheye``; a driver without distortion ``""``."""

TOLERANCE_PX: Final = 0.1
"""A pixel that is undistorted and then distorted again may be off by this much."""

CONVERGED: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)


class CalibrationFault(ValueError):
    """A value of a calibration is invalid.

    Attributes:
        key: Name of the value, such as ``k``.
        found: What was found, such as ``3 numbers``.
        allowed: What is allowed instead.
    """

    def __init__(self, key: str, found: str, allowed: str) -> None:
        super().__init__(f"{key}: {found}; allowed: {allowed}")
        self.key = key
        self.found = found
        self.allowed = allowed


def model_named(name: str) -> DistortionModel:
    """Return the distortion model with a name in ROS, or with one of ``ALIASES``.

    Raises:
        CalibrationFault: No model has this name.
    """
    if name in COEFFICIENTS:
        return name
    if name not in ALIASES:
        raise CalibrationFault("distortion_model", repr(name)[:80], ", ".join(COEFFICIENTS))
    return ALIASES[name]


@dataclass(frozen=True)
class CameraModel:
    """The intrinsic parameters of a camera for one size of its picture.

    Args:
        width: Width of the picture, pixels.
        height: Height of the picture, pixels.
        k: The camera matrix, row by row, pixels: fx, 0, cx, 0, fy, cy, 0, 0, 1.
        distortion_model: Its name in ROS.
        d: The model's coefficients in OpenCV's order; empty for no distortion.

    Sources: D. C. Brown, "Decentering distortion of lenses", 1966 (plumb_bob); J. Kannala and
    S. Brandt, "A generic camera model and calibration method for conventional, wide-angle and
    fish-eye lenses", 2006 (equidistant).

    Raises:
        CalibrationFault: A value is invalid.
    """

    width: int
    height: int
    k: tuple[float, ...]
    distortion_model: DistortionModel = "plumb_bob"
    d: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for key, side in (("width", self.width), ("height", self.height)):
            if not 1 <= side <= 65535:
                raise CalibrationFault(key, str(side), "1 to 65535")
        checked_numbers("k", self.k, 9)
        fx, skew, _, under, fy, _, *last = self.k
        if fx <= 0 or fy <= 0 or skew or under or last != [0, 0, 1]:
            form = "[fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx and fy above 0"
            raise CalibrationFault("k", str(list(self.k)), form)
        counts = COEFFICIENTS[self.distortion_model]
        if len(self.d) not in counts:
            allowed = f"{' or '.join(map(str, counts))} for {self.distortion_model}"
            raise CalibrationFault("d", f"{len(self.d)} numbers", allowed)
        checked_numbers("d", self.d, len(self.d))

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The camera matrix, (3, 3)."""
        return np.array(self.k).reshape(3, 3)

    @cached_property
    def coefficients(self) -> NDArray[np.float64]:
        """The coefficients of the distortion, (n,)."""
        return np.array(self.d)

    def undistorted(self, points: Points) -> Points:
        """Remove the lens's distortion from points.

        Args:
            points: (n, 2), pixels of the picture.

        Returns:
            (n, 2), pixels of an ideal lens with the same camera matrix; NaN where the model has
            no inverse, which happens outside of the calibrated part of the picture.
        """
        if not self.d or not len(points):
            return points.copy()
        given = np.ascontiguousarray(points, np.float64).reshape(-1, 1, 2)
        module = cv2.fisheye if self.distortion_model == "equidistant" else cv2
        found = module.undistortPoints(
            given, self.matrix, self.coefficients, P=self.matrix, criteria=CONVERGED
        )
        ideal = np.asarray(found, np.float64).reshape(-1, 2)
        with np.errstate(all="ignore"):
            off = np.abs(self.distorted(ideal) - points).max(axis=1, initial=0.0)
        ideal[~(off <= TOLERANCE_PX)] = np.nan  # also where it is NaN itself
        return ideal

    def distorted(self, points: Points) -> Points:
        """Add the lens's distortion to points, (n, 2), given in pixels of an ideal lens."""
        if not self.d or not len(points):
            return points.copy()
        fx, _, cx, _, fy, cy, *_ = self.k
        x, y = (points[:, 0] - cx) / fx, (points[:, 1] - cy) / fy
        rays = np.stack([x, y, np.ones_like(x)], axis=1).reshape(-1, 1, 3)
        still = np.zeros(3)
        if self.distortion_model == "equidistant":
            shown, _ = cv2.fisheye.projectPoints(rays, still, still, self.matrix, self.coefficients)
        else:
            shown, _ = cv2.projectPoints(rays, still, still, self.matrix, self.coefficients)
        return np.asarray(shown, np.float64).reshape(-1, 2)


def checked_numbers(key: str, numbers: tuple[float, ...], count: int) -> None:
    """Check that a value has ``count`` numbers, and that all are finite.

    Raises:
        CalibrationFault: It has not; ``key`` is the name of the value.
    """
    if len(numbers) != count:
        raise CalibrationFault(key, f"{len(numbers)} numbers", f"{count}")
    if not np.isfinite(numbers).all():
        raise CalibrationFault(key, str(list(numbers)), "finite numbers")
