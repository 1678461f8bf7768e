"""Draws the empty room: a plastered wall, a skirting board, a tiled floor in perspective."""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

HORIZON = 0.22  # vanishing line of the floor, share of the height
WALL_FOOT = 0.50  # where the wall meets the floor, share of the height
SKIRTING = 0.028  # share of the height

WALLS = ((176, 186, 190), (186, 182, 172), (172, 184, 178), (180, 178, 184))  # BGR
FLOORS = ((118, 138, 156), (126, 134, 140), (112, 130, 140), (124, 132, 150))

Plane = NDArray[np.float32]
Row = TypeVar("Row", float, Plane)


def draw_room(width: int, height: int, seed: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the empty room, (height, width, 3) uint8 BGR; the seed determines its texture."""
    rng = np.random.default_rng(seed)
    wall_color = np.array(WALLS[rng.integers(len(WALLS))], np.float32)
    floor_color = np.array(FLOORS[rng.integers(len(FLOORS))], np.float32)
    foot = round(height * WALL_FOOT)
    board = foot - max(1, round(height * SKIRTING))
    room = np.empty((height, width, 3), np.float32)
    room[:foot] = _wall(rng, width, foot)[:, :, None] * wall_color
    room[foot:] = _floor(rng, width, height, foot)[:, :, None] * floor_color
    room[board:foot] = wall_color * 1.16
    room[foot - 1] = floor_color * 0.50
    room[board] = wall_color * 0.80
    # Fine grain, since no part of a real surface has a single grey level.
    room *= 1.0 + 0.015 * rng.standard_normal((height, width, 1), np.float32)
    # Lit from the upper left, darker in the corners.
    x = np.linspace(-1, 1, width, dtype=np.float32)[None, :, None]
    y = np.linspace(-1, 1, height, dtype=np.float32)[:, None, None]
    room *= 1.06 - 0.05 * x - 0.04 * y - 0.07 * (x * x + y * y)
    return np.clip(room, 0, 255, out=room).astype(np.uint8)


def floor_depth(row: Row, height: int) -> Row:
    """Return the distance of the floor seen at a row, or at rows; 1 at the lower edge."""
    return (1.0 - HORIZON) * height / (row + 0.5 - HORIZON * height)


def _clouds(rng: np.random.Generator, width: int, height: int, cells: int) -> Plane:
    """Return smooth random blotches, (height, width) float32 around 0 with deviation 1."""
    grid = rng.standard_normal((cells, cells), np.float32)
    return np.asarray(cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC), np.float32)


def _wall(rng: np.random.Generator, width: int, height: int) -> Plane:
    plaster = 1.0 + 0.020 * _clouds(rng, width, height, 5) + 0.012 * _clouds(rng, width, height, 24)
    # Joints between wall panels, a dark line with a bright edge beside it.
    for joint in (np.arange(1, 5) + rng.uniform(-0.15, 0.15)) / 5:
        x = round(width * float(joint))
        plaster[:, x : x + 1] *= 0.86
        plaster[:, x + 1 : x + 2] *= 1.05
    return np.asarray(plaster, np.float32)


def _floor(rng: np.random.Generator, width: int, height: int, foot: int) -> Plane:
    columns = np.arange(width, dtype=np.float32)[None, :]
    depth = floor_depth(np.arange(foot, height, dtype=np.float32)[:, None], height)
    across, along = (columns - width * 0.5) / height * depth * 4.0, depth * 6.0
    shades = rng.uniform(0.92, 1.06, (64, 64)).astype(np.float32)
    floor = shades[np.floor(along).astype(int) % 64, np.floor(across).astype(int) % 64]
    # A joint is at least a pixel wide; otherwise it would disappear in places far away.
    pixel_x, pixel_y = depth * 4.0 / height, depth * depth * 6.0 / ((1.0 - HORIZON) * height)
    joint = np.minimum(
        np.abs(across - np.round(across)) / np.maximum(0.03, pixel_x),
        np.abs(along - np.round(along)) / np.maximum(0.03, pixel_y),
    )
    floor = floor * (0.80 + 0.20 * np.clip(joint, 0, 1))
    blotches = 0.018 * _clouds(rng, width, floor.shape[0], 40)
    return np.asarray(floor * (1.0 + blotches), np.float32)
