"""The homography from undistorted pixels to a plane in the world, and its estimation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.camera_model import CalibrationFault, Points, checked_numbers

LEAST_PAIRS: Final = 4

MAX_COORDINATE: Final = 1e12
"""Largest coordinate allowed, so that no product of coordinates overflows."""

ROUNDING: Final = 1e-12
"""Ratio of the smallest to the largest singular value up to which a matrix counts as singular."""

LEAST_RATIO: Final = 1e-3
"""Least ratio of singular values, with normalised points, at which pairs are not degenerate."""


class DegeneratePairs(ValueError):
    """Pairs of points do not determine a homography; the text says why, and what is needed."""


@dataclass(frozen=True)
class Plane:
    """A homography from undistorted pixels to X, Y on a plane, in the units of the world.

    Args:
        h: Its nine numbers, row by row. Their sign matters: pixels for which the third row gives
            a number above 0 show the plane, those with 0 its horizon, and the others no point of
            it.

    Raises:
        CalibrationFault: ``h`` is not nine finite numbers, or the matrix is not invertible.
    """

    h: tuple[float, ...]

    def __post_init__(self) -> None:
        checked_numbers("plane", self.h, 9)
        if _is_singular(self.matrix):
            raise CalibrationFault("plane", str(list(self.h)), "an invertible 3x3 matrix")

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The homography, (3, 3)."""
        return np.array(self.h, np.float64).reshape(3, 3)

    def world(self, points: Points) -> Points:
        """Map undistorted pixels, (n, 2), to X, Y on the plane; NaN at and beyond the horizon."""
        return _mapped(self.matrix, points, one_side=True)

    def pixels(self, world: Points) -> Points:
        """Map points X, Y on the plane, (n, 2), to undistorted pixels."""
        return _mapped(np.linalg.inv(self.matrix).astype(np.float64), world, one_side=False)


@dataclass(frozen=True)
class PlaneFit:
    """A homography estimated from pairs of points, and how well it fits them.

    Attributes:
        plane: The homography.
        residuals: Distance of each pair's world point from its mapped pixel, (n,), world units.
            All are 0 with four pairs, which are always fitted exactly.
        per_pixel: Largest standard deviation of a mapped pixel among the pairs, world units, if
            each pixel coordinate of the pairs has a standard deviation of one pixel.
    """

    plane: Plane
    residuals: NDArray[np.float64]
    per_pixel: float

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, in the units of the world."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def fit_plane(pixels: Points, world: Points) -> PlaneFit:
    """Estimate the homography from undistorted pixels to the world by least squares.

    Source: R. Hartley and A. Zisserman, "Multiple View Geometry in Computer Vision", 2004, 4.1 and
    4.4.4 (the direct linear transformation of normalised points), refined in world units.

    Args:
        pixels: (n, 2), n at least 4.
        world: (n, 2), the same points on the plane, in any unit.

    Raises:
        DegeneratePairs: There are fewer than four pairs, three of four are on one line, they
            contradict each other, or a number is not finite or too large.
    """
    if len(pixels) < LEAST_PAIRS:
        raise DegeneratePairs(
            f"{len(pixels)} pairs do not determine a plane; at least {LEAST_PAIRS} are needed, "
            "no three of them on a line"
        )
    for name, points in (("pixels", pixels), ("world", world)):
        if not (np.abs(points) <= MAX_COORDINATE).all():
            raise DegeneratePairs(
                f"a number of the {name} is not finite or beyond {MAX_COORDINATE:g}"
            )
    matrix = _homography(pixels, world)
    if matrix is None or _independence(pixels, world, matrix) < LEAST_RATIO:
        raise DegeneratePairs(
            "the points are on a line, or all but one are, so they do not determine a plane; "
            "needed are four of which no three are on a line, far from each other"
        )
    side = np.concatenate([pixels, np.ones((len(pixels), 1))], axis=1) @ matrix[2]
    if side.min() * side.max() <= 0:
        raise DegeneratePairs(
            "the pairs contradict each other: some of the points would be beyond the horizon of "
            "the others; are two of them swapped?"
        )
    matrix = matrix * np.sign(side[0]) / np.linalg.norm(matrix)
    try:
        plane = Plane(tuple(matrix.ravel().tolist()))
    except CalibrationFault as fault:
        raise DegeneratePairs(f"the pairs do not determine a plane: {fault}") from None
    residuals = np.linalg.norm(plane.world(pixels) - world, axis=1)
    return PlaneFit(plane, residuals, _per_pixel(pixels, world))


def _per_pixel(pixels: Points, world: Points) -> float:
    """Return the largest standard deviation of a mapped pixel, given one pixel of noise."""
    base = _mapped(_homography(pixels, world), pixels, one_side=False)
    variance = np.zeros(len(pixels))
    for index in np.ndindex(pixels.shape):
        moved = pixels.copy()
        moved[index] += 1.0
        shifted = _mapped(_homography(moved, world), pixels, one_side=False)
        variance += ((shifted - base) ** 2).sum(axis=1)
    return float(np.sqrt(variance.max()))


def _homography(pixels: Points, world: Points) -> NDArray[np.float64] | None:
    """Return the homography of least squared error in the world; None if OpenCV finds none.

    Both sets of points are normalised first, since OpenCV's refinement depends on their units and
    on their distance from the origin.
    """
    to_pixels, to_world = _normalisation(pixels), _normalisation(world)
    found, _ = cv2.findHomography(
        _mapped(to_pixels, pixels, one_side=False), _mapped(to_world, world, one_side=False), 0
    )
    if found is None:
        return None
    return np.asarray(np.linalg.solve(to_world, found @ to_pixels), np.float64)


def _independence(pixels: Points, world: Points, matrix: NDArray[np.float64]) -> float:
    """Return how far pairs are from being degenerate, and their homography from being singular.

    The result is the smaller of two ratios of singular values. For points on a line it is 0: the
    first ratio is 0 if they are on a line both in the picture and in the world, the second if
    only in one of them.
    """
    to_pixels, to_world = _normalisation(pixels), _normalisation(world)
    rows = []
    for (x, y), (u, v) in zip(
        _mapped(to_pixels, pixels, one_side=False),
        _mapped(to_world, world, one_side=False),
        strict=True,
    ):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y, -u])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y, -v])
    equations = np.linalg.svd(np.array(rows), compute_uv=False)
    homography = np.linalg.svd(to_world @ matrix @ np.linalg.inv(to_pixels), compute_uv=False)
    return float(min(equations[7] / equations[0], homography[2] / homography[0]))


def _normalisation(points: Points) -> NDArray[np.float64]:
    """Return the matrix that moves the points' mean to the origin and scales their spread to 1."""
    center = points.mean(axis=0)
    size = float(np.sqrt(((points - center) ** 2).sum(axis=1).mean() / 2)) or 1.0
    return np.array([[1 / size, 0, -center[0] / size], [0, 1 / size, -center[1] / size], [0, 0, 1]])


def _is_singular(matrix: NDArray[np.float64]) -> bool:
    """Return whether a matrix is singular, independent of the units of its rows and columns."""
    for axis in (1, 0, 1, 0):
        sizes = np.abs(matrix).max(axis=axis, keepdims=True)
        if not sizes.all():
            return True
        matrix = matrix / sizes
    values = np.linalg.svd(matrix, compute_uv=False)
    return bool(values[2] <= ROUNDING * values[0])


def _mapped(matrix: NDArray[np.float64] | None, points: Points, *, one_side: bool) -> Points:
    if matrix is None:
        return np.full_like(points, np.nan)
    lifted = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix.T
    depth = np.where(lifted[:, 2] > 0, lifted[:, 2], np.nan) if one_side else lifted[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(lifted[:, :2] / depth[:, None], np.float64)
