"""Reads BSDS500's training images and the boundaries that people drew in them.

Source: P. Arbelaez, M. Maire, C. Fowlkes, J. Malik, "Contour Detection and Hierarchical Image
Segmentation", 2011. The images are for research use.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

FOLDER = "bsds_train"
HELD_BACK = 40
"""The last images by name, which ``train`` leaves out unless it trains on all."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """An image and the boundaries that people drew in it.

    Args:
        name: The file's name without suffix.
        picture: (height, width, 3) uint8, BGR.
        boundaries: For each of 4 to 9 people (height, width) bool, lines of one pixel's width.
    """

    name: str
    picture: NDArray[np.uint8]
    boundaries: list[NDArray[np.bool_]]


def image_names(folder: Path, *, held_back: bool) -> list[str]:
    """Return the names of the images that are held back, or of the others, in order."""
    names = sorted(path.stem for path in folder.glob("*.jpg"))
    return names[-HELD_BACK:] if held_back else names[:-HELD_BACK]


def read(folder: Path, name: str) -> Drawn:
    """Read an image and its boundaries."""
    picture = cv2.imread(str(folder / f"{name}.jpg"), cv2.IMREAD_COLOR)
    truth = loadmat(str(folder / f"{name}.mat"))["groundTruth"]
    drawn = [truth[0, person]["Boundaries"][0, 0] > 0 for person in range(truth.shape[1])]
    return Drawn(name, np.asarray(picture, np.uint8), drawn)
