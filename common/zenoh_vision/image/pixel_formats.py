"""Pixel formats: encodings, conversions between them, and raw bytes to arrays and back.

The names and their meaning are those of sensor_msgs/image_encodings; conversions between 8 and
16 bits scale by 65535 / 255 = 257, as cv_bridge does, unless a range of values is known (depth.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image import depth
from zenoh_vision.image.limits import MAX_PIXELS

Pixels = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class PixelEncoding:
    """The properties of an encoding; ``space`` is the name that libjpeg and OpenCV share."""

    channels: int
    dtype: np.dtype[Any]
    space: str


class _Encodings(dict[str, PixelEncoding]):
    """The encodings by name."""

    def __missing__(self, name: str) -> PixelEncoding:
        """Refuse a name that is not known.

        Raises:
            PayloadError: ``unsupported_encoding``, listing those that are known.
        """
        raise PayloadError("unsupported_encoding", f"{name!r}, known are {', '.join(self)}")


ENCODINGS: Final = _Encodings(
    {
        "mono8": PixelEncoding(1, np.dtype("<u1"), "GRAY"),
        "mono16": PixelEncoding(1, np.dtype("<u2"), "GRAY"),
        "bgr8": PixelEncoding(3, np.dtype("<u1"), "BGR"),
        "rgb8": PixelEncoding(3, np.dtype("<u1"), "RGB"),
        "bgra8": PixelEncoding(4, np.dtype("<u1"), "BGRA"),
        "rgba8": PixelEncoding(4, np.dtype("<u1"), "RGBA"),
        "16UC1": PixelEncoding(1, np.dtype("<u2"), "GRAY"),
        "32FC1": PixelEncoding(1, np.dtype("<f4"), "GRAY"),
    }
)
_BY_PIXEL: Final = {
    (each.channels, each.dtype): name
    for name, each in ENCODINGS.items()
    if name in ("mono8", "mono16", "bgr8", "bgra8")
}
DEEP: Final = frozenset({"mono16", "16UC1", "32FC1"})
"""Encodings of more than 8 bits: ``16UC1`` is depth in millimetres, ``32FC1`` in metres."""
DISTANCES: Final = frozenset({"16UC1", "32FC1"})
"""Encodings of depth: their values are distances, which grey levels are not."""


def encoding_of(pixels: NDArray[Any], named: str | None = None) -> str:
    """Return the encoding of pixels: that of a name, or by channels and dtype, colour as B, G, R.

    Raises:
        PayloadError: ``unsupported_encoding``: there is no such encoding, or the array has another
            shape or dtype.
    """
    if not isinstance(pixels, np.ndarray) or pixels.ndim not in (2, 3):
        found = getattr(pixels, "shape", type(pixels).__name__)
        raise PayloadError(
            "unsupported_encoding", f"{found} instead of an array (height, width[, channels])"
        )
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    encoding = named or _BY_PIXEL.get((channels, pixels.dtype))
    if encoding is None:
        raise PayloadError(
            "unsupported_encoding",
            f"{channels} channels of {pixels.dtype}; allowed are 1, 3 or 4 of uint8, 1 of uint16",
        )
    known = ENCODINGS[encoding]
    if (channels, pixels.dtype) != (known.channels, known.dtype):
        raise PayloadError(
            "unsupported_encoding",
            f"{channels} channels of {pixels.dtype} are not {encoding}, which has "
            f"{known.channels} of {known.dtype}",
        )
    return encoding


def convert(pixels: Pixels, source: str, target: str) -> Pixels:
    """Return pixels in another encoding; the same array when nothing must change.

    Args:
        pixels: (height, width[, channels]) in encoding ``source``; not modified.
        source: Encoding name of ``pixels``.
        target: Encoding name wanted. Added alpha is opaque; dropped alpha is ignored.
    """
    if source == target:
        return pixels
    if source in DEEP:
        sixteen = sixteen_bits(pixels, source)
        if target in DEEP:
            return depth.metres(sixteen) if target == "32FC1" else sixteen
        return convert(depth.eight_bits(sixteen), "mono8", target)
    if target in DEEP:
        gray = convert(pixels, source, "mono8")
        return convert(gray.astype(np.uint16) * np.uint16(depth.RATIO), "mono16", target)
    code = getattr(cv2, f"COLOR_{ENCODINGS[source].space}2{ENCODINGS[target].space}")
    return np.asarray(cv2.cvtColor(pixels, code), np.uint8)


def sixteen_bits(pixels: Pixels, encoding: str) -> NDArray[np.uint16]:
    """Return pixels of an encoding in ``DEEP`` as uint16; ``32FC1`` becomes millimetres."""
    return np.asarray(depth.millimetres(pixels) if encoding == "32FC1" else pixels, np.uint16)


def raw_size(encoding: str | None, width: int, height: int) -> int:
    """Return the number of bytes of raw pixels of this encoding and size.

    Raises:
        PayloadError: ``unsupported_encoding``, or ``too_large``.
    """
    known = ENCODINGS[encoding or ""]
    if width * height > MAX_PIXELS:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {MAX_PIXELS} in all")
    return width * height * known.channels * known.dtype.itemsize


def to_raw(pixels: Pixels, encoding: str) -> bytes:
    """Return pixel rows without padding, 16-bit values little-endian."""
    return np.ascontiguousarray(pixels, ENCODINGS[encoding].dtype).tobytes()
