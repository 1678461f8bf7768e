"""Pictures of two bytes a pixel, as most webcams deliver them unless they are asked for JPEGs.

They are converted to BGR straight into the memory that is to hold the pixels. A JPEG is made of
the BGR: separating the planes takes as long as OpenCV's conversion and libjpeg's back together.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image import codecs
from zenoh_vision.image.stored import StoredPicture, are_equal


class PackedPicture(StoredPicture):
    """A picture as YUYV: BT.601 in 4:2:2, of the limited range.

    Args:
        packed: (height, width, 2) uint8, contiguous, width even: of each two pixels Y, U, Y, V.
            Not modified, and kept.

    Raises:
        ValueError: It is no such array.
    """

    def __init__(self, packed: NDArray[np.uint8]) -> None:
        super().__init__()
        if not is_packed(packed):
            raise ValueError(f"{packed.shape} {packed.dtype} is no YUYV")
        self._packed = packed

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        height, width = self._packed.shape[:2]
        return width, height

    def jpeg(self, quality: int) -> bytes:
        """Return the picture as a JPEG of this quality, 1 to 100."""
        return codecs.encode_jpeg(self.bgr(), "bgr8", quality)

    def cropped(self, box: tuple[int, int, int, int]) -> PackedPicture | None:
        """Return the part in a rectangle; None if it begins or ends between two paired pixels."""
        x, y, width, height = box
        if x % 2 or width % 2:
            return None
        return PackedPicture(np.ascontiguousarray(self._packed[y : y + height, x : x + width]))

    def equals(self, other: StoredPicture) -> bool:
        """Tell whether another picture has the same values."""
        return isinstance(other, PackedPicture) and are_equal(self._packed, other._packed)

    def _made_bgr(self) -> NDArray[np.uint8]:
        return np.asarray(cv2.cvtColor(self._packed, cv2.COLOR_YUV2BGR_YUYV), np.uint8)

    def _write_bgr(self, target: NDArray[np.uint8], /) -> bool:
        # OpenCV would make new memory instead of writing to an array that it cannot use.
        if target.shape != (*self._packed.shape[:2], 3) or target.dtype != np.uint8:
            raise ValueError(f"{target.shape} {target.dtype} is no memory for {self.size}")
        if not (target.flags.c_contiguous and target.flags.writeable):
            return False
        cv2.cvtColor(self._packed, cv2.COLOR_YUV2BGR_YUYV, dst=target)
        return True


def is_packed(image: NDArray[np.uint8]) -> bool:
    """Tell whether an array can be YUYV: two bytes a pixel, and whole pairs of pixels."""
    paired = image.ndim == 3 and image.shape[2] == 2 and image.shape[1] % 2 == 0
    return paired and image.dtype == np.uint8 and image.flags.c_contiguous
