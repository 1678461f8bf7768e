"""Recognises a change of the light of the whole scene, and fits the background to it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

CELLS = 8
"""Number of columns of the grid in which pictures are compared; its cells are about square."""

LEAST_GAIN, MOST_GAIN = 0.1, 10.0


def relit(background: Image, picture: Image, known: Image | None) -> Image:
    """Return a background as it would look in the light of a picture.

    The gain of each colour is the median ratio of the two pictures in each cell of a coarse grid,
    interpolated between the cells. It therefore follows lamps and clouds, but not objects that are
    smaller than a cell.

    Args:
        background: (height, width, 3) uint8 BGR.
        picture: The same.
        known: (height, width) uint8, not 0 at known objects, which are not compared; None without.

    Returns:
        (height, width, 3) uint8 BGR.
    """
    height, width = picture.shape[:2]
    rows = max(1, round(CELLS * height / width))
    gains = np.ones((rows, CELLS, 3), np.float32)
    ys = np.linspace(0, height, rows + 1).astype(int)
    xs = np.linspace(0, width, CELLS + 1).astype(int)
    for row in range(rows):
        for column in range(CELLS):
            cell = slice(ys[row], ys[row + 1], 2), slice(xs[column], xs[column + 1], 2)
            before, after = background[cell].reshape(-1, 3), picture[cell].reshape(-1, 3)
            if known is not None:
                free = known[cell].ravel() == 0
                if np.count_nonzero(free) < 16:
                    gains[row, column] = np.nan
                    continue
                before, after = before[free], after[free]
            gains[row, column] = np.median((after + 1.0) / (before + 1.0), axis=0)
    whole = np.nanmedian(gains.reshape(-1, 3), axis=0)
    gains = np.where(np.isnan(gains), whole, gains).astype(np.float32)
    smooth = cv2.resize(np.clip(gains, LEAST_GAIN, MOST_GAIN), (width, height))
    return np.asarray(np.clip(background * smooth, 0, 255), np.uint8)


def same_texture(background: Image, picture: Image, where: Image) -> float:
    """Return the correlation of the gradients of background and picture, from -1 to 1.

    It is high if only the light has changed, low if an object covers the scene or the camera was
    moved.

    Args:
        background: (height, width, 3) uint8 BGR.
        picture: The same.
        where: (height, width) uint8, not 0 where they are compared.
    """
    gradients = []
    for image in (background, picture):
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        along = [cv2.Sobel(grey, cv2.CV_32F, dx, 1 - dx)[where > 0] for dx in (0, 1)]
        gradients.append(np.concatenate(along))
    before, after = gradients
    norm = float(np.sqrt(np.dot(before, before) * np.dot(after, after)))
    return float(np.dot(before, after)) / norm if norm > 0 else 0.0
