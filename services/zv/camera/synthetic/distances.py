"""Draws the scene as a depth camera sees it: the distance of every pixel, in millimetres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from zv.camera.synthetic.backdrop import WALL_FOOT, floor_depth
from zv.camera.synthetic.sprite import Sprite, overlap

NEAR_MM = 2000.0
"""Distance of the floor at the lower edge of the picture; the wall is then at about 5.6 m."""

BEFORE_WALL_MM = 300.0
"""Distance from the wall of the kite, which has no floor under it."""

MM_PER_LEVEL = 4.0
"""Deviation of a depth for each grey level of noise; 2 grey levels make 8 mm."""

Depth = NDArray[np.uint16]


def room_depth(width: int, height: int) -> Depth:
    """Return the distances in the empty room, (height, width) uint16, millimetres."""
    foot = round(height * WALL_FOOT)
    rows = [floor_depth(max(row, foot), height) for row in range(height)]
    depth = np.rint(NEAR_MM * np.array(rows)).astype(np.uint16)
    return np.repeat(depth[:, None], width, axis=1)


def object_depth(ground_y: float, height: int) -> int:
    """Return the distance of an object that stands on a row of the picture, millimetres."""
    foot = round(height * WALL_FOOT)
    if ground_y < foot:
        return round(NEAR_MM * floor_depth(foot, height) - BEFORE_WALL_MM)
    return round(NEAR_MM * floor_depth(ground_y, height))


def paste(depth: Depth, sprite: Sprite, left: int, top: int, millimetres: int) -> None:
    """Draw an object into distances, in place; parts outside are clipped."""
    windows = overlap(depth.shape, sprite.mask.shape, left, top)
    if windows is not None:
        there, here = windows
        depth[there][sprite.mask[here] > 0] = millimetres
