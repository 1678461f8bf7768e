"""Selects the part of a frame in which edges are detected: region, scale and mask."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zv.edge.contours import Lines
from zv.edge.detectors.rendering import Gray, Picture

Box = tuple[int, int, int, int]
"""x, y, width, height, pixels."""

Map = TypeVar("Map", NDArray[np.uint8], NDArray[np.float32])


def corners(box: Box | None, height: int, width: int) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of a region in a frame of this size, clipped to it.

    Raises:
        PayloadError: ``region_outside``: the frame has no pixel of the region.
    """
    if box is None:
        return 0, 0, width, height
    x, y = box[:2]
    right, bottom = min(x + box[2], width), min(y + box[3], height)
    if x >= right or y >= bottom:
        raise PayloadError(
            "region_outside", f"region {box} is outside of a frame of {width}x{height} pixels"
        )
    return x, y, right, bottom


def selected(
    picture: Picture, box: Box | None = None, scale: float = 1.0, mask: Gray | None = None
) -> SelectedPart:
    """Return the selected part of a frame.

    Args:
        picture: (height, width[, 3]) uint8.
        box: Region of the frame, clipped to the frame; None for all of it.
        scale: Factor by which the region is reduced, above 0 and at most 1.
        mask: (height, width) uint8 of any size, stretched to the frame; edges where it is 0 are
            dropped. None without a mask.

    Raises:
        PayloadError: ``region_outside``: the frame has no pixel of the region.
    """
    shape = height, width = picture.shape[:2]
    x, y, right, bottom = corners(box, height, width)
    part = picture[y:bottom, x:right]
    if scale != 1:
        size = max(1, round((right - x) * scale)), max(1, round((bottom - y) * scale))
        part = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
    return SelectedPart(part, (x, y, right - x, bottom - y), shape, mask)


@dataclass(frozen=True, slots=True)
class SelectedPart:
    """The selected part of one frame; converts results to the whole frame.

    Attributes:
        picture: Its pixels, at the reduced scale.
        box: Its position and size in the frame.
        frame_shape: Height and width of the frame.
        mask: As in ``selected``.
    """

    picture: Picture
    box: Box
    frame_shape: tuple[int, int]
    mask: Gray | None

    @property
    def is_whole(self) -> bool:
        """Whether the part is the whole frame at its full scale."""
        return self.picture.shape[:2] == self.frame_shape

    @property
    def factor(self) -> NDArray[np.float64]:
        """Width and height of a pixel of the part in pixels of the frame, at least 1."""
        width, height = self.box[2:]
        return np.array([width / self.picture.shape[1], height / self.picture.shape[0]])

    def whole(self, found: Map) -> Map:
        """Return a picture of the part enlarged to the size of the frame, 0 outside of the part.

        Each pixel at a reduced scale becomes several equal ones.
        """
        if self.is_whole:
            return found
        x, y, width, height = self.box
        larger = cv2.resize(found, (width, height), interpolation=cv2.INTER_NEAREST)
        whole = np.zeros((*self.frame_shape, *found.shape[2:]), found.dtype)
        whole[y : y + height, x : x + width] = larger
        return whole

    def masked(self, found: Map) -> Map:
        """Return edges or strengths of the part, set to 0 where the mask is 0."""
        if self.mask is None:
            return found
        height, width = self.frame_shape
        x, y, box_width, box_height = self.box
        mask = cv2.resize(self.mask, (width, height), interpolation=cv2.INTER_NEAREST)
        mask = mask[y : y + box_height, x : x + box_width]
        smaller = cv2.resize(mask, found.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        return np.where(smaller > 0, found, found.dtype.type(0))

    def in_frame(self, lines: Lines) -> Lines:
        """Convert lines from pixels of the part to pixels of the frame."""
        if self.is_whole:
            return lines
        x, y = self.box[:2]
        factor = self.factor
        # At both scales, the centre of pixel 0 is half a pixel from the border.
        shift = np.array([x, y]) + (factor - 1) / 2
        polylines = tuple(
            replace(
                line,
                points=np.rint(line.points * factor + shift).astype(np.int32),
                length=line.length * float(factor.mean()),
            )
            for line in lines.polylines
        )
        return replace(
            lines,
            polylines=polylines,
            segments=lines.segments * np.tile(factor, 2) + np.tile(shift, 2),
            circles=None
            if lines.circles is None
            else lines.circles * [*factor, factor.mean()] + [*shift, 0],
        )
