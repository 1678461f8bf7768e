"""Pictures of two bytes a pixel, as most webcams deliver them unless they are asked for JPEGs.

They are converted to BGR straight into the memory that is to hold the pixels. A JPEG is made of
the BGR: separating the planes takes as long as OpenCV's conversion and libjpeg's back together.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.picture import Box, Picture, are_equal


class PackedPicture(Picture):
    """A picture as YUYV: BT.601 in 4:2:2, of the limited range.

    Args:
        packed: (height, width, 2) uint8, contiguous, width even: of each two pixels Y, U, Y, V.
            Not modified, and kept.

    Raises:
        ValueError: It is no such array.
    """

    def __init__(self, packed: NDArray[np.uint8]) -> None:
        if not is_packed(packed):
            raise ValueError(f"{packed.shape} {packed.dtype} is no YUYV")
        super().__init__("bgr8", packed.shape[1], packed.shape[0])
        self._packed = packed

    def cropped(self, box: Box) -> Picture:
        """Return the part in a rectangle; as pixels if it divides two that are paired."""
        x, y, width, height = box
        if x % 2 or width % 2:
            return super().cropped(box)
        return PackedPicture(np.ascontiguousarray(self._packed[y : y + height, x : x + width]))

    def write(self, target: NDArray[np.uint8]) -> None:
        """Write the pixel rows to memory, converted into it if they were not made before."""
        if self._pixels is not None:
            super().write(target)
            return
        # OpenCV would make new memory instead of writing to an array that it cannot use.
        rows = target.reshape(self.height, self.width, 3)
        cv2.cvtColor(self._packed, cv2.COLOR_YUV2BGR_YUYV, dst=rows)

    def _make_pixels(self) -> NDArray[np.uint8]:
        return np.asarray(cv2.cvtColor(self._packed, cv2.COLOR_YUV2BGR_YUYV), np.uint8)

    def _equals(self, other: PackedPicture) -> bool:
        return are_equal(self._packed, other._packed)


def is_packed(image: NDArray[np.uint8]) -> bool:
    """Tell whether an array can be YUYV: two bytes a pixel, and whole pairs of pixels."""
    paired = image.ndim == 3 and image.shape[2] == 2 and image.shape[1] % 2 == 0
    return paired and image.dtype == np.uint8 and image.flags.c_contiguous
