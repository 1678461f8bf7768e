"""Draws, clips and pastes a small picture with a hard outline."""

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
SUBPIXEL_BITS = 4
ARC_CORNERS = 73
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
        columns, rows = self._size[0] * fine, self._size[1] * fine
        self._paint = np.zeros((rows, columns, 3), np.uint8)
        self._cover = np.zeros((rows, columns), np.uint8)

    def polygon(self, corners: Sequence[Point] | NDArray[np.float64], color: Color) -> None:
        """Fill a polygon."""
        fixed = np.rint(np.asarray(corners) * (self._scale * (1 << SUBPIXEL_BITS)))
        points = [fixed.astype(np.int32)]
        cv2.fillPoly(self._paint, points, color, cv2.LINE_8, SUBPIXEL_BITS)
        cv2.fillPoly(self._cover, points, FULL, cv2.LINE_8, SUBPIXEL_BITS)

    def disc(self, center: Point, radius: float, color: Color) -> None:
        """Fill a circle."""
        self.arc(center, (radius, radius), (0.0, 360.0), color)

    def arc(self, center: Point, radii: Point, degrees: Point, color: Color) -> None:
        """Fill a sector of an ellipse between two angles, clockwise from the right."""
        turn = np.radians(np.linspace(degrees[0], degrees[1], ARC_CORNERS))
        rim = np.column_stack((np.cos(turn), np.sin(turn))) * radii + center
        whole = degrees[1] - degrees[0] >= 360
        self.polygon(rim if whole else np.vstack((rim, center)), color)

    def limb(self, begin: Point, end: Point, thickness: float, color: Color) -> None:
        """Draw a thick line with round ends."""
        dx, dy = end[0] - begin[0], end[1] - begin[1]
        length = max((dx * dx + dy * dy) ** 0.5, 1e-9)
        sx, sy = -dy / length * thickness / 2, dx / length * thickness / 2
        left = [(x + sx, y + sy) for x, y in (begin, end)]
        right = [(x - sx, y - sy) for x, y in (end, begin)]
        self.polygon(left + right, color)
        self.disc(begin, thickness / 2, color)
        self.disc(end, thickness / 2, color)

    def sprite(self, grain: NDArray[np.float32], facing: int = 1) -> Sprite:
        """Return the drawing as a sprite.

        Args:
            grain: Texture by which the colours are multiplied, float32 around 1, at least as
                large as the sprite in both directions.
            facing: -1 for the mirror image. The light still comes from the left.

        Returns:
            A sprite of the pixels that the drawing covers by half or more. Those at its rim are
            blended with the background.
        """
        cover = cv2.resize(self._cover, self._size, interpolation=cv2.INTER_AREA)
        paint = cv2.resize(self._paint, self._size, interpolation=cv2.INTER_AREA)
        if facing < 0:
            cover, paint = cv2.flip(cover, 1), cv2.flip(paint, 1)
        width, height = self._size
        light = np.linspace(1.10, 0.82, width, dtype=np.float32)[None, :]
        shaded = paint * (grain[:height, :width] * light)[:, :, None]
        inside = cover >= (FULL + 1) // 2
        keep = np.where(inside, FULL - cover, FULL).astype(np.uint8)
        return Sprite(
            mask=np.where(inside, FULL, 0).astype(np.uint8),
            paint=np.where(inside[:, :, None], np.clip(shaded, 0, 255), 0).astype(np.uint8),
            keep=np.repeat(keep[:, :, None], 3, axis=2),
        )


def shadow(width: float, height: float) -> Sprite:
    """Return the soft shadow on the ground under an object; sizes in pixels."""
    columns, rows = max(2, round(width)), max(2, round(height))
    x = np.linspace(-1, 1, columns, dtype=np.float32)[None, :]
    y = np.linspace(-1, 1, rows, dtype=np.float32)[:, None]
    dark = np.clip(1.0 - (x * x + y * y), 0, 1) * SHADOW_DEPTH
    keep = np.rint(FULL * (1.0 - dark)).astype(np.uint8)
    return Sprite(
        mask=np.zeros((rows, columns), np.uint8),
        paint=np.zeros((rows, columns, 3), np.uint8),
        keep=np.repeat(keep[:, :, None], 3, axis=2),
    )
