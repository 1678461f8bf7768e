"""Pictures as planes of luma and chroma, as a video decoder delivers them and a JPEG stores them.

A JPEG of such a picture needs neither the conversion to BGR nor the one back, which cost more than
a quarter of its encoding.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from zenoh_vision.image import bands
from zenoh_vision.image.picture import Box, Picture, are_equal

Plane = NDArray[np.uint8]
Planes = tuple[Plane, Plane, Plane]

BLACK = 16
"""Factors of the limited range, in which videos store luma as 16 to 235, chroma as 16 to 240."""
LUMA_SCALE = 255 / 219
CHROMA_SCALE = 255 / 224
LUMA_OFFSET = -0.5  # rounds down, as libav's conversion to BGR does
CHROMA_OFFSET = 128 - 112 * CHROMA_SCALE


class PlanarPicture(Picture):
    """A decoded picture of BT.601 in 4:2:0.

    Args:
        planes: Luma (height, width), both even; blue and red chroma, half as high and wide;
            uint8. Not modified, and kept.
        full_range: Whether black is 0 and white 255, as in a JPEG, instead of 16 and 235.
        to_bgr: Makes the pixels, (height, width, 3).

    Raises:
        ValueError: A side is odd, for which libjpeg 3.1 encodes a wrong last row.
    """

    def __init__(
        self,
        planes: Planes,
        *,
        full_range: bool,
        to_bgr: Callable[[], NDArray[np.uint8]],
    ) -> None:
        if not are_even(*planes[0].shape):
            raise ValueError(f"planes of {planes[0].shape}: both sides must be even")
        super().__init__("bgr8", planes[0].shape[1], planes[0].shape[0])
        self.planes = planes
        self._is_full_range = full_range
        self._full: Planes | None = planes if full_range else None
        self._to_bgr = to_bgr

    def prepare(self) -> None:
        """Scale the planes as a JPEG stores them, which ``jpeg`` does if it was not done before."""
        self._full_range()

    def jpeg(self, quality: int) -> bytes:
        """Return the picture as a JPEG of this quality, 1 to 100."""
        luma, blue, red = self._full_range()

        def encode_rows(rows: slice) -> bytes:
            half = slice(rows.start // 2, rows.stop // 2)
            planes = luma[rows], blue[half], red[half]
            jpeg: bytes = simplejpeg.encode_jpeg_yuv_planes(*planes, quality=quality)
            return jpeg

        return bands.encode(*self.size, encode_rows, mcu=16)

    def cropped(self, box: Box) -> Picture:
        """Return the part in a rectangle; as pixels if a number of it is odd."""
        x, y, width, height = box
        if any(number % 2 for number in box):
            return super().cropped(box)
        rows, columns = slice(y, y + height), slice(x, x + width)
        half = (slice(y // 2, (y + height) // 2), slice(x // 2, (x + width) // 2))
        luma, blue, red = self.planes
        return PlanarPicture(
            (
                np.ascontiguousarray(luma[rows, columns]),
                np.ascontiguousarray(blue[half]),
                np.ascontiguousarray(red[half]),
            ),
            full_range=self._is_full_range,
            to_bgr=lambda: np.ascontiguousarray(self.pixels[rows, columns], np.uint8),
        )

    def _make_pixels(self) -> NDArray[np.uint8]:
        return self._to_bgr()

    def _equals(self, other: PlanarPicture) -> bool:
        return all(map(are_equal, self.planes, other.planes))

    def _full_range(self) -> Planes:
        with self._lock:
            if self._full is None:
                luma, blue, red = self.planes
                self._full = (
                    _scaled(luma, LUMA_SCALE, LUMA_OFFSET),
                    _scaled(blue, CHROMA_SCALE, CHROMA_OFFSET),
                    _scaled(red, CHROMA_SCALE, CHROMA_OFFSET),
                )
            return self._full


def are_even(height: int, width: int) -> bool:
    """Tell whether planes of this size can be encoded."""
    return height % 2 == 0 == width % 2


def _scaled(plane: Plane, scale: float, offset: float) -> Plane:
    """Return a plane of limited range in full range; values below or above it are clipped."""
    # A weighted sum saturates at 0. No other operation of OpenCV scales, adds and saturates so in
    # one pass; the second weight of 0 leaves one plane.
    return np.asarray(cv2.addWeighted(plane, scale, plane, 0.0, offset - BLACK * scale), np.uint8)
