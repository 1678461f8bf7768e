"""Draws calibration boards as a known camera sees them."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tools.calibrate.board import Board

SQUARE_PIXELS = 40
MARGIN = 1  # white squares around a chessboard


def flat(board: Board) -> NDArray[np.uint8]:
    """Return a board seen straight on, with ``SQUARE_PIXELS`` for each square."""
    if board.kind == "charuco":
        size = (board.columns * SQUARE_PIXELS, board.rows * SQUARE_PIXELS)
        picture = board.drawing.generateImage(size, marginSize=0)
        return cv2.copyMakeBorder(picture, *[SQUARE_PIXELS] * 4, cv2.BORDER_CONSTANT, value=255)
    rows, columns = board.rows + 1, board.columns + 1
    black = (np.add.outer(np.arange(rows), np.arange(columns)) % 2) == 0
    squares = np.pad(np.where(black, 0, 255), MARGIN, constant_values=255).astype(np.uint8)
    return np.kron(squares, np.ones((SQUARE_PIXELS, SQUARE_PIXELS), np.uint8))


@cache
def rays_of(
    k: tuple[float, ...], d: tuple[float, ...], size: tuple[int, int], fisheye: bool
) -> NDArray[np.float64]:
    """Return the directions of all pixels of a picture, (3, n)."""
    width, height = size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2)
    points = pixels.reshape(-1, 1, 2).astype(np.float64)
    module = cv2.fisheye if fisheye else cv2
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-9)
    matrix = np.array(k).reshape(3, 3)
    rays = module.undistortPoints(points, matrix, np.array(d), criteria=criteria).reshape(-1, 2)
    return np.concatenate([rays, np.ones((len(rays), 1))], axis=1).T


def seen(
    board: Board,
    k: NDArray[np.float64],
    d: tuple[float, ...],
    size: tuple[int, int],
    turn: NDArray[np.float64],
    move: NDArray[np.float64],
    *,
    fisheye: bool = False,
) -> NDArray[np.uint8]:
    """Return the picture of a board, (height, width), as a camera shows it.

    Args:
        board: Its first inner corner is the origin, X along its rows.
        k: Camera matrix, (3, 3).
        d: Coefficients of plumb_bob, or of equidistant with ``fisheye``.
        size: Width and height, pixels.
        turn: Rodrigues' vector of the board, (3,).
        move: Its origin in front of the camera, in the unit of its squares, (3,).
        fisheye: The distortion model.
    """
    width, height = size
    rays = rays_of(tuple(k.ravel().tolist()), d, size, fisheye)
    rotation = cv2.Rodrigues(turn)[0]
    # Where each ray meets the board's plane: R [X Y 0]' + t is along the ray.
    plane = np.stack([rotation[:, 0], rotation[:, 1], move], axis=1)
    on_board = np.linalg.inv(plane) @ rays
    x, y = on_board[:2] / on_board[2]
    # The centre of a drawn pixel is at a whole number, the origin at the corner of four.
    origin = SQUARE_PIXELS * 2 - 0.5
    scale = SQUARE_PIXELS / board.square
    across = (x * scale + origin).reshape(height, width).astype(np.float32)
    down = (y * scale + origin).reshape(height, width).astype(np.float32)
    drawn = cv2.GaussianBlur(flat(board), (0, 0), 1.2)
    return cv2.remap(drawn, across, down, cv2.INTER_LINEAR, borderValue=140)


def poses_of(board: Board) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return turns and moves for ``seen`` that show a board in all parts, tilted and near."""
    less = 2 if board.kind == "charuco" else 1
    middle = np.array([board.columns - less, board.rows - less, 0]) * board.square / 2
    found = []
    for x, y, turned, leaned, away in (
        (0, 0, 0, 0, 260),
        (-110, -60, 25, 0, 330),
        (110, -60, -25, 0, 330),
        (-110, 60, 0, 25, 330),
        (110, 60, 0, -25, 330),
        (0, -70, 10, 22, 300),
        (0, 70, -10, -22, 300),
        (-130, 0, 20, 10, 330),
        (130, 0, -20, -10, 330),
        (0, 0, 30, 10, 230),
    ):
        turn = np.radians(np.array([leaned, turned, 3.0]))
        move = np.array([x, y, away], np.float64) - cv2.Rodrigues(turn)[0] @ middle
        found.append((turn, move))
    return found
