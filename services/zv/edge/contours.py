"""Traces the lines of an edge map as polylines, straight segments and circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.rendering import Gray

MAX_POINTS: Final = 20_000
"""Largest number of points of all polylines of a frame; at 7 bytes each they fit into a message."""

CIRCLE_ARC: Final = 0.5
"""Least share of its circumference along which a circle must be seen."""
CIRCLE_ERROR: Final = 0.02
"""Largest root mean square distance of a contour from its circle, relative to the radius; 0.7
pixels are always allowed, since a line's pixels are that far from it."""
SMALLEST_RADIUS: Final = 4.0

NEIGHBOURS: Final = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)


@dataclass(frozen=True, slots=True)
class Polyline:
    """One line of an edge map.

    Attributes:
        points: (n, 2) int32, x and y, n at least 1, along the line.
        length: Length of the line before it was simplified, pixels.
        closed: Whether the last point is joined to the first.
    """

    points: NDArray[np.int32]
    length: float
    closed: bool


@dataclass(frozen=True, slots=True)
class Lines:
    """The lines of an edge map, longest first.

    Attributes:
        polylines: The polylines that were kept.
        omitted: Number of lines that were long enough, but not kept.
        segments: (n, 4) float64: x1, y1, x2, y2 of straight pieces.
        circles: (n, 3) float64: x, y, radius, largest first; None if circles were not requested.
    """

    polylines: tuple[Polyline, ...]
    omitted: int
    segments: NDArray[np.float64]
    circles: NDArray[np.float64] | None


@dataclass(frozen=True, slots=True)
class LineLimits:
    """Limits for tracing an edge map.

    Attributes:
        max_count: Largest number of polylines, and of segments.
        min_length: Least number of pixels of a line, and least length of a segment, pixels.
        tolerance: Largest distance of a polyline from the line's pixels, pixels.
        circles: Whether to find circles.
    """

    max_count: int = 100
    min_length: float = 10
    tolerance: float = 1.0
    circles: bool = False


def trace(edges: Gray, limits: LineLimits) -> Lines:
    """Trace the lines of an edge map.

    The map is cut at the junctions of lines, so that each part is a plain curve whose contour goes
    along it and back. Curves are simplified by the algorithm of Ramer, Douglas and Peucker.

    Args:
        edges: (height, width) uint8, not 0 on lines that are one pixel wide; not modified.
        limits: Which lines are kept.
    """
    curves, omitted = _longest_curves(_curve_pixels(edges), limits)
    polylines = []
    left = MAX_POINTS
    for points, length, closed in curves:
        simple = cv2.approxPolyDP(points, limits.tolerance, closed)[:, 0]
        if len(simple) > left:
            continue
        left -= len(simple)
        polylines.append(Polyline(np.asarray(simple, np.int32), length, closed))
    omitted += len(curves) - len(polylines)
    circles = _circles(curves) if limits.circles else None
    return Lines(tuple(polylines), omitted, _segments(polylines, limits), circles)


def _curve_pixels(edges: Gray) -> Gray:
    """Return the pixels of plain curves as 1, without redundant corners and without junctions."""
    thin = np.zeros((edges.shape[0] + 2, edges.shape[1] + 2), np.bool_)
    inner = thin[1:-1, 1:-1]
    inner[:] = edges != 0
    for up, left in ((True, True), (True, False), (False, True), (False, False)):
        _remove_corners(thin, up=up, left=left)
    ones = np.ascontiguousarray(inner).view(np.uint8)
    border = cv2.BORDER_CONSTANT
    junctions = cv2.filter2D(ones, -1, NEIGHBOURS, borderType=border) > 2
    return np.asarray(ones & ~junctions.view(np.uint8), np.uint8)


def _remove_corners(thin: NDArray[np.bool_], *, up: bool, left: bool) -> None:
    """Remove the corners of stairs, whose two neighbours touch each other diagonally.

    All can be removed at once, since removing two neighbouring ones never cuts the line.

    Args:
        thin: (height + 2, width + 2) with a margin of False; modified.
        up: Whether one of the two neighbours is above, else below.
        left: Whether the other one is on the left, else on the right.
    """
    above, below = (slice(0, -2), slice(2, None)) if up else (slice(2, None), slice(0, -2))
    near, far = (slice(0, -2), slice(2, None)) if left else (slice(2, None), slice(0, -2))
    middle = slice(1, -1)
    thin[middle, middle] &= ~(
        thin[above, middle]
        & thin[middle, near]
        & ~thin[below, middle]
        & ~thin[middle, far]
        & ~thin[below, far]
    )


Curve = tuple[NDArray[np.int32], float, bool]
"""Points (n, 1, 2) along a curve, its length in pixels, and whether it is closed."""


def _longest_curves(pixels: Gray, limits: LineLimits) -> tuple[list[Curve], int]:
    """Return the longest curves, and the number of others that are long enough."""
    # This algorithm takes a third of the time of the default.
    count, labels, boxes, _ = cv2.connectedComponentsWithStatsWithAlgorithm(
        pixels, 8, cv2.CV_32S, cv2.CCL_GRANA
    )
    sizes = boxes[:, cv2.CC_STAT_AREA].copy()
    sizes[0] = 0  # the background
    # Twice as many are traced as are kept, since the order by number of pixels is not quite the
    # order by length.
    long_enough = np.flatnonzero(sizes >= max(1, limits.min_length))
    kept = long_enough[np.argsort(-sizes[long_enough], kind="stable")][: 2 * limits.max_count]
    chosen = np.zeros(count, np.uint8)
    chosen[kept] = 1
    found, _ = cv2.findContours(chosen[labels], cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)[-2:]
    seen = np.zeros(count, np.bool_)
    curves = []
    for outline in found:
        x, y = outline[0, 0]
        if seen[labels[y, x]]:
            continue  # the inner side of a closed curve
        seen[labels[y, x]] = True
        points, closed = _along(np.asarray(outline, np.int32))
        curves.append((points, float(cv2.arcLength(points, closed)), closed))
    curves.sort(key=lambda curve: -curve[1])
    untraced = len(long_enough) - len(kept)
    return curves[: limits.max_count], untraced + max(0, len(curves) - limits.max_count)


def _along(outline: NDArray[np.int32]) -> tuple[NDArray[np.int32], bool]:
    """Return the points from one end of a curve to the other, or once around a closed one.

    The outline of an open curve goes there and back, and turns at the two ends.
    """
    turns = np.flatnonzero((np.roll(outline, 1, 0) == np.roll(outline, -1, 0)).all((1, 2)))
    if len(outline) < 3 or len(turns) == 0:
        return outline, len(outline) > 3
    return np.roll(outline, -turns[0], 0)[: len(outline) // 2 + 1], False


def _segments(polylines: list[Polyline], limits: LineLimits) -> NDArray[np.float64]:
    """Return the straight pieces of polylines that are long enough, longest first."""
    pieces = [np.empty((0, 4))]
    for line in polylines:
        points = np.vstack([line.points, line.points[:1]]) if line.closed else line.points
        pieces.append(np.hstack([points[:-1], points[1:]]).astype(np.float64))
    found = np.vstack(pieces)
    lengths = np.hypot(found[:, 2] - found[:, 0], found[:, 3] - found[:, 1])
    order = np.argsort(-lengths, kind="stable")
    order = order[lengths[order] >= limits.min_length]
    return np.asarray(found[order[: limits.max_count]], np.float64)


def _circles(curves: list[Curve]) -> NDArray[np.float64]:
    """Fit circles to curves and return those that fit, (n, 3), largest first.

    Source: I. Kasa, "A Circle Fitting Procedure and Its Error Analysis", 1976: least squares of
    x^2 + y^2 = 2 a x + 2 b y + c.
    """
    found = []
    for points, _, _ in curves:
        place = points[:, 0].astype(np.float64)
        if len(place) < 2 * np.pi * SMALLEST_RADIUS * CIRCLE_ARC / 2**0.5:
            continue
        center = place.mean(0)
        x, y = (place - center).T
        basis = np.column_stack([2 * x, 2 * y, np.ones_like(x)])
        (a, b, c), *_ = np.linalg.lstsq(basis, x * x + y * y, rcond=None)
        radius = np.sqrt(max(c + a * a + b * b, 0))
        error = np.sqrt(np.mean((np.hypot(x - a, y - b) - radius) ** 2))
        angles = np.unique(np.rint(np.arctan2(y - b, x - a) * (32 / np.pi))).size / 64
        if (
            radius >= SMALLEST_RADIUS
            and error <= max(0.7, CIRCLE_ERROR * radius)
            and angles >= CIRCLE_ARC
        ):
            found.append((center[0] + a, center[1] + b, radius))
    return np.array(sorted(found, key=lambda circle: -circle[2]), np.float64).reshape(-1, 3)
