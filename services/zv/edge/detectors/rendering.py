"""Renders the steps of a detector as pictures: strengths as grey, directions as hue."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Gray = NDArray[np.uint8]
"""(height, width) uint8."""

Picture = NDArray[np.uint8]
"""(height, width) grey, or (height, width, 3) in BGR order."""

Strength = NDArray[np.float32]
"""(height, width) float32, at least 0."""

WEAK, STRONG = 128, 255
"""Grey levels of the pixels above the low threshold only, and of those above the high threshold."""


def as_gray(strength: Strength, full_scale: float) -> Gray:
    """Return strengths as grey, (height, width) uint8: 255 * sqrt(strength / full_scale).

    The scale is fixed, so that a video does not flicker, and the root makes weak edges visible: a
    tenth of ``full_scale`` becomes 81.
    """
    shown = strength * np.float32(1 / full_scale)
    np.sqrt(shown, out=shown)
    shown *= 255
    return np.asarray(cv2.convertScaleAbs(shown), np.uint8)


def as_sixteen_bits(strength: Strength, full_scale: float) -> NDArray[np.uint16]:
    """Return strengths as (height, width) uint16, linear: ``full_scale`` becomes 65535."""
    scaled = np.rint(strength * np.float32(65535 / full_scale))
    return np.asarray(np.clip(scaled, 0, 65535), np.uint16)


def as_hue(gx: NDArray[Any], gy: NDArray[Any], brightness: Gray) -> Picture:
    """Return directions as hue, (height, width, 3) uint8 in BGR order.

    Args:
        gx: Derivative to the right.
        gy: Derivative downwards.
        brightness: (height, width) uint8; black where there is no gradient.

    The hue is the angle of the gradient, which points to the brighter side: red to the right,
    yellow-green down, cyan to the left, violet up.
    """
    degrees = cv2.phase(gx.astype(np.float32), gy.astype(np.float32), angleInDegrees=True)
    halves = np.asarray(degrees, np.float32)
    halves *= 0.5
    hue = np.asarray(np.rint(halves, out=halves), np.uint8)
    hue[hue == 180] = 0
    full = np.full_like(hue, 255)
    return np.asarray(cv2.cvtColor(cv2.merge([hue, full, brightness]), cv2.COLOR_HSV2BGR), np.uint8)


def in_two_grays(suppressed: Strength, low: float, high: float) -> Gray:
    """Return strengths above ``high`` as 255, others above ``low`` as 128, and the rest as 0."""
    shown = np.where(suppressed > low, np.uint8(WEAK), np.uint8(0))
    return np.where(suppressed > high, np.uint8(STRONG), shown)
