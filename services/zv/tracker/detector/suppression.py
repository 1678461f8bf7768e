"""Bounds the boxes of a model, and leaves out those that show an object once more."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_CANDIDATES: Final = 2000
"""The surest boxes that are compared with each other: it takes 20 ms."""

MOST_BOXES: Final = 300
"""The surest boxes that are kept."""

SAME: Final = 0.9
"""Two boxes that share so much of their union show one object, whatever their classes."""


class Candidates(NamedTuple):
    """Boxes as a model returns them, in any order."""

    boxes: NDArray[np.float32]  # (n, 4) float32: left, top, right, bottom in pixels
    scores: NDArray[np.float32]  # (n,) float32, 0 to 1
    classes: NDArray[np.int64]  # (n,) int64: number of the class
    known: int = 0  # how many classes the model has scores for; 0: its outputs do not tell

    def only(self, where: NDArray[np.bool_] | NDArray[np.intp]) -> Candidates:
        """Return those of a mask or of indices."""
        return Candidates(self.boxes[where], self.scores[where], self.classes[where])


def finite(found: Candidates) -> tuple[Candidates, int]:
    """Return the boxes whose numbers are finite, and how many are not."""
    good = np.isfinite(found.boxes).all(axis=1) & np.isfinite(found.scores)
    count = len(good) - int(np.count_nonzero(good))
    return (found.only(good) if count else found), count


def bounded(found: Candidates, most: int) -> tuple[Candidates, int]:
    """Return the surest boxes, surest first, and how many were left out."""
    order = np.argsort(-found.scores, kind="stable")
    return found.only(order[:most]), max(0, len(order) - most)


def suppressed(found: Candidates, overlap: float) -> Candidates:
    """Leave out each box that overlaps a surer one of its class, or is the same as any surer one.

    Args:
        found: At most ``MOST_CANDIDATES`` boxes.
        overlap: Intersection over union from which on two boxes of a class show one object.

    Returns:
        The rest, the surest first.

    Source: non-maximum suppression, A. Neubeck and L. Van Gool, 2006 (OpenCV).
    """
    if len(found.scores) < 2:
        return found
    sides: Any = found.boxes.astype(np.float64)
    sides[:, 2:] -= sides[:, :2]
    scores: Any = found.scores.astype(np.float64)
    classes: Any = found.classes.astype(np.int32)
    kept: Any = cv2.dnn.NMSBoxesBatched(sides, scores, classes, 0.0, overlap)
    found = found.only(np.asarray(kept, np.intp).reshape(-1))
    sides, scores = sides[kept], scores[kept]
    if len(set(found.classes.tolist())) > 1:
        kept = cv2.dnn.NMSBoxes(sides, scores, 0.0, SAME)
        found = found.only(np.asarray(kept, np.intp).reshape(-1))
    return found
