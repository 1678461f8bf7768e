"""Says which views of a board a calibration still needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from zv.tools.calibrate.board import BoardView

LEAST_VIEWS: Final = 8
LEAST_TILT_DEG: Final = 15.0
TILTED_VIEWS: Final = 2
"""Least number of tilted views in each of two directions. Without them, focal length and distance
cannot be told apart."""

LEAST_SHARE: Final = 0.15
"""Share of the picture's area that the board must fill once: a small board does not show the lens's
distortion."""

PARTS: Final = (
    ("top left", "top", "top right"),
    ("left", "middle", "right"),
    ("bottom left", "bottom", "bottom right"),
)

NEW_PLACE: Final = 0.06
NEW_SIZE: Final = 0.06
NEW_TILT_DEG: Final = 8.0


@dataclass(frozen=True)
class Pose:
    """Where a board is in a picture, and how it lies, roughly.

    Attributes:
        x: Centre of the board, as a share of the picture's width.
        y: Centre of the board, as a share of the picture's height.
        share: Share of the picture's area that the corners span.
        turned_deg: Angle to the picture's plane, around the vertical axis.
        leaned_deg: Angle to the picture's plane, around the horizontal axis.
        parts: The parts of the picture, rows and columns of three, in which there are corners.
    """

    x: float
    y: float
    share: float
    turned_deg: float
    leaned_deg: float
    parts: frozenset[tuple[int, int]]

    def is_like(self, other: Pose) -> bool:
        """Tell whether two views are so similar that the second adds little."""
        return (
            abs(self.x - other.x) < NEW_PLACE
            and abs(self.y - other.y) < NEW_PLACE
            and abs(self.share**0.5 - other.share**0.5) < NEW_SIZE
            and abs(self.turned_deg - other.turned_deg) < NEW_TILT_DEG
            and abs(self.leaned_deg - other.leaned_deg) < NEW_TILT_DEG
        )


def pose_of(view: BoardView) -> Pose:
    """Return where a board is and how it lies; the tilt assumes a usual focal length."""
    size = np.array([view.width, view.height], np.float64)
    x, y = view.pixels.mean(axis=0) / size
    hull = cv2.convexHull(view.pixels.astype(np.float32))
    cells = np.clip(np.floor(view.pixels / size * 3), 0, 2).astype(int)
    focal = float(size.max())
    matrix = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
    flat = np.concatenate([view.points, np.zeros((len(view.points), 1))], axis=1)
    _, turn, _ = cv2.solvePnP(flat, view.pixels, matrix, None, flags=cv2.SOLVEPNP_IPPE)
    normal = cv2.Rodrigues(turn)[0][:, 2]
    normal = normal * (1 if normal[2] >= 0 else -1)
    turned, leaned = np.degrees(np.arctan2(normal[:2], normal[2]))
    return Pose(
        float(x),
        float(y),
        float(cv2.contourArea(hull) / size.prod()),
        float(turned),
        float(leaned),
        frozenset((int(row), int(column)) for column, row in cells),
    )


def missing(poses: Sequence[Pose]) -> list[str]:
    """Return as text which views are missing in a set; empty if it is good enough."""
    found = []
    if (more := LEAST_VIEWS - len(poses)) > 0:
        found.append(f"{more} more pictures that differ" if more > 1 else "1 more that differs")
    covered = frozenset[tuple[int, int]]().union(*(pose.parts for pose in poses))
    parts = [
        name
        for row, names in enumerate(PARTS)
        for column, name in enumerate(names)
        if (row, column) not in covered
    ]
    if parts:
        found.append(f"the board in these parts of the picture: {', '.join(parts)}")
    for words, tilts in (
        ("turned to the left or right", [abs(pose.turned_deg) for pose in poses]),
        ("leaned forwards or backwards", [abs(pose.leaned_deg) for pose in poses]),
    ):
        lacking = TILTED_VIEWS - sum(tilt >= LEAST_TILT_DEG for tilt in tilts)
        if lacking > 0:
            found.append(f"{lacking} with the board {words} by {LEAST_TILT_DEG:g} degrees or more")
    if max((pose.share for pose in poses), default=0.0) < LEAST_SHARE:
        found.append(f"one with the board over {LEAST_SHARE:.0%} of the picture: hold it nearer")
    return found
