"""A scene with a background of several colours: leaves that sway, and a screen that flickers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.tracker.scenes import Scene

Floats = NDArray[np.float32]

TREE = (90, 40, 190, 200)
SCREEN = (470, 120, 90, 60)
"""x, y, width, height, pixels."""

LEAF = 7
"""Size of a leaf, pixels."""

SWAYS = ((4.0, 0.6), (2.5, 1.7))
"""How far leaves sway, pixels, and how often in a second; neighbours sway nearly alike."""

GUST_S = 7.0
BRIGHT_S = 0.45
"""The screen is bright for so long, and then dark for as long."""


@dataclass(frozen=True)
class Leaves(Scene):
    """Actors before a tree in the wind and a screen; the wind comes in gusts and never ceases."""

    def backdrop(self, time_s: float) -> NDArray[np.uint8]:
        """Return the scene without actors at a time, a new array."""
        bgr = self._wall.copy()
        x, y, width, height = TREE
        crown, columns, rows, phases = self._crown
        wind = 0.65 + 0.35 * np.sin(2 * np.pi * time_s / GUST_S)
        shift = sum(
            wind * reach * np.sin(2 * np.pi * often * time_s + (1 + number) * phases)
            for number, (reach, often) in enumerate(SWAYS)
        )
        moved = (columns + shift).astype(np.float32), (rows + 0.4 * shift).astype(np.float32)
        leaves = cv2.remap(crown, *moved, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        bgr[y : y + height, x : x + width] = leaves
        x, y, width, height = SCREEN
        bright = int(time_s / BRIGHT_S) % 2 == 0
        bgr[y : y + height, x : x + width] = (210, 190, 170) if bright else (90, 40, 30)
        return bgr

    @cached_property
    def _crown(self) -> tuple[NDArray[np.uint8], Floats, Floats, Floats]:
        """Return the leaves at rest, column and row of each pixel, and the phase of its swaying."""
        rng = np.random.default_rng((self.seed, 4))
        _, _, width, height = TREE

        def blotches(grain: int) -> Floats:
            coarse = rng.standard_normal((-(-height // grain), -(-width // grain)), np.float32)
            size = (width, height)
            return np.asarray(cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC), np.float32)

        leaf = np.clip(blotches(LEAF) * 4 + 0.5, 0, 1)[:, :, None]  # with little between
        green = np.array([45.0, 90.0, 60.0]) + 8 * blotches(3)[:, :, None]
        sky = np.array([205.0, 190.0, 180.0])
        crown = np.clip(np.rint(green * leaf + sky * (1 - leaf)), 0, 255).astype(np.uint8)
        rows, columns = np.mgrid[:height, :width].astype(np.float32)
        return crown, columns, rows, 2 * blotches(40)
