"""Draws small pictures with a hard outline, and pastes them into large ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Color = tuple[int, int, int]
Point = tuple[float, float]
Window = tuple[slice, slice]

FULL = 255
BITS = 4
"""Fraction of the coordinates that OpenCV gets."""
SHADOW_DEPTH = 0.40  # MOG2 detects 0 to 0.5 as a shadow, which the tracker leaves out


@dataclass(frozen=True, slots=True)
class Sprite:
    """An object in one pose.

    Attributes:
        mask: (height, width) uint8, 255 on the object, else 0.
        paint: (height, width, 3) uint8 BGR, its colours, weighted with the coverage at the rim.
        keep: (height, width, 3) uint8, share of the background that remains, of 255.
    """

    mask: NDArray[np.uint8]
    paint: NDArray[np.uint8]
    keep: NDArray[np.uint8]

    def paste(self, bgr: NDArray[np.uint8], left: int, top: int) -> None:
        """Draw it into a (height, width, 3) uint8 picture, in place; parts outside are clipped."""
        windows = overlap(bgr.shape, self.mask.shape, left, top)
        if windows is not None:
            there, here = windows
            region = bgr[there]
            cv2.multiply(region, self.keep[here], dst=region, scale=1 / FULL)
            cv2.add(region, self.paint[here], dst=region)


def overlap(
    onto: Sequence[int], size: Sequence[int], left: int, top: int
) -> tuple[Window, Window] | None:
    """Return the common part of a large picture and a small one, or None if they do not overlap.

    Args:
        onto: Shape of the large one: height, width, ...
        size: Shape of the small one.
        left: x of the small one's left column in the large one; may be negative.
        top: y of its top row.

    Returns:
        A window of the large picture and the same one of the small picture.
    """
    x0, x1 = max(left, 0), min(left + size[1], onto[1])
    y0, y1 = max(top, 0), min(top + size[0], onto[0])
    if x0 >= x1 or y0 >= y1:
        return None
    return np.s_[y0:y1, x0:x1], np.s_[y0 - top : y1 - top, x0 - left : x1 - left]


class Sketch:
    """A drawing in fine resolution, from which sprites are made.

    Lengths are in units of its height, origin top left, y down.

    Args:
        width: In units of its height.
        height: Pixels.
    """

    def __init__(self, width: float, height: float) -> None:
        self._size = (max(2, round(width * height)), max(2, round(height)))
        fine = 4 if self._size[1] < 400 else 2
        self._scale = height * fine
        self._canvas = np.zeros((self._size[1] * fine, self._size[0] * fine, 4), np.uint8)

    def polygon(self, corners: Sequence[Point], color: Color) -> None:
        """Fill a polygon."""
        cv2.fillPoly(self._canvas, [self._fixed(corners)], (*color, FULL), cv2.LINE_8, BITS)

    def limb(self, begin: Point, end: Point, thickness: float, color: Color) -> None:
        """Draw a thick line with round ends; a disc if both ends are the same."""
        first, last = self._fixed((begin, end)).tolist()
        pixels = max(1, round(thickness * self._scale))
        cv2.line(self._canvas, first, last, (*color, FULL), pixels, cv2.LINE_8, BITS)

    def sector(self, center: Point, radius: float, degrees: Point, color: Color) -> None:
        """Fill a sector of a circle between two angles, clockwise from the right."""
        middle, axes = self._fixed((center, (radius, radius))).tolist()
        rgba = (*color, FULL)
        cv2.ellipse(self._canvas, middle, axes, 0, *degrees, rgba, -1, cv2.LINE_8, BITS)

    def sprite(self, grain: NDArray[np.float32], facing: int = 1) -> Sprite:
        """Return the drawing as a sprite of the pixels that it covers by half or more.

        Args:
            grain: Texture by which the colours are multiplied, float32 around 1, at least as
                large as the sprite in both directions.
            facing: -1 for the mirror image. The light still comes from the left.
        """
        drawn = cv2.resize(self._canvas, self._size, interpolation=cv2.INTER_AREA)
        drawn = drawn if facing > 0 else cv2.flip(drawn, 1)
        (width, height), cover = self._size, drawn[:, :, 3]
        light = np.linspace(1.10, 0.82, width, dtype=np.float32)[None, :]
        shaded = drawn[:, :, :3] * (grain[:height, :width] * light)[:, :, None]
        inside = cover >= (FULL + 1) // 2
        return Sprite(
            mask=np.where(inside, FULL, 0).astype(np.uint8),
            paint=np.where(inside[:, :, None], np.clip(shaded, 0, FULL), 0).astype(np.uint8),
            keep=_three(np.where(inside, FULL - cover, FULL)),
        )

    def _fixed(self, points: Sequence[Point]) -> NDArray[np.int32]:
        return np.rint(np.asarray(points) * (self._scale * (1 << BITS))).astype(np.int32)


def shadow(width: float, height: float) -> Sprite:
    """Return the soft shadow on the ground under an object; sizes in pixels."""
    shape = max(2, round(height)), max(2, round(width))
    y, x = (np.linspace(-1, 1, side, dtype=np.float32) for side in shape)
    dark = np.clip(1.0 - (x * x + (y * y)[:, None]), 0, 1) * SHADOW_DEPTH
    nothing = np.zeros((*shape, 3), np.uint8)
    return Sprite(nothing[:, :, 0], nothing, _three(np.rint(FULL * (1.0 - dark))))


def _three(plane: NDArray[np.generic]) -> NDArray[np.uint8]:
    return np.repeat(plane.astype(np.uint8)[:, :, None], 3, axis=2)
