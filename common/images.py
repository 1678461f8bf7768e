"""Pixel encodings, and pictures as JPEG, PNG and raw bytes to arrays and back.

The encodings' names and meaning are those of sensor_msgs/image_encodings; conversions between
8 and 16 bits scale by 65535 / 255 = 257, as cv_bridge does.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from common.errors import PayloadError

Pixels = NDArray[np.uint8] | NDArray[np.uint16]

MAX_PIXELS: Final = 7680 * 4320
MAX_COMPRESSED_BYTES: Final = 32 << 20
JPEG_START: Final = b"\xff\xd8\xff"
PNG_START: Final = b"\x89PNG\r\n\x1a\n"
DEPTH_RATIO: Final = 257  # 65535 / 255
ANIMATION_CHUNKS: Final = (b"acTL", b"fcTL", b"fdAT")
"""Of an animated PNG, no frame of a camera; OpenCV 5.0 dies of malformed ones (SIGSEGV)."""


@dataclass(frozen=True, slots=True)
class PixelEncoding:
    """What the pixels of an encoding are: channel count, dtype, and libjpeg's name for them."""

    channels: int
    dtype: np.dtype[Any]
    jpeg: str


ENCODINGS: Final = {
    "mono8": PixelEncoding(1, np.dtype("<u1"), "GRAY"),
    "mono16": PixelEncoding(1, np.dtype("<u2"), "GRAY"),
    "bgr8": PixelEncoding(3, np.dtype("<u1"), "BGR"),
    "rgb8": PixelEncoding(3, np.dtype("<u1"), "RGB"),
    "bgra8": PixelEncoding(4, np.dtype("<u1"), "BGRA"),
    "rgba8": PixelEncoding(4, np.dtype("<u1"), "RGBA"),
}


def encoding_named(name: str | None) -> PixelEncoding:
    """Return the encoding of a name.

    Raises:
        PayloadError: ``unsupported_encoding``, listing those that are known.
    """
    found = ENCODINGS.get(name or "")
    if found is None:
        raise PayloadError("unsupported_encoding", f"{name!r}, known are {', '.join(ENCODINGS)}")
    return found


def convert(pixels: Pixels, source: str, target: str) -> Pixels:
    """Return pixels in another encoding; the same array when nothing must change.

    Args:
        pixels: (height, width[, channels]) in encoding ``source``; not modified.
        source: Encoding name of ``pixels``.
        target: Encoding name wanted. Added alpha is opaque; dropped alpha is ignored.
    """
    if source == target:
        return pixels
    if source == "mono16":
        return convert(eight_bits(pixels), "mono8", target)
    if target == "mono16":
        gray = convert(pixels, source, "mono8")
        return gray.astype(np.uint16) * np.uint16(DEPTH_RATIO)
    names = {"mono8": "GRAY", "bgr8": "BGR", "rgb8": "RGB", "bgra8": "BGRA", "rgba8": "RGBA"}
    code = getattr(cv2, f"COLOR_{names[source]}2{names[target]}")
    return np.asarray(cv2.cvtColor(pixels, code), np.uint8)


def eight_bits(pixels: Pixels) -> NDArray[np.uint8]:
    """Return 16-bit pixels of any shape scaled to 8 bits by 255 / 65535, rounded."""
    return np.asarray((pixels.astype(np.uint32) + DEPTH_RATIO // 2) // DEPTH_RATIO, np.uint8)


def encode_jpeg(pixels: Pixels, encoding: str, quality: int) -> bytes:
    """Return 8-bit pixels as a JPEG (4:2:0, or grey for ``mono8``); alpha is left out.

    Args:
        pixels: (height, width[, channels]) uint8.
        encoding: Encoding name of ``pixels``, one of 8 bits.
        quality: 1 to 100.
    """
    array = np.ascontiguousarray(pixels if pixels.ndim == 3 else pixels[:, :, np.newaxis])
    space = ENCODINGS[encoding].jpeg
    sampling = "Gray" if space == "GRAY" else "420"
    jpeg: bytes = simplejpeg.encode_jpeg(array, quality, space, sampling)
    return jpeg


def decode_jpeg(jpeg: bytes, encoding: str, least: tuple[int, int] = (0, 0)) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG in an 8-bit encoding.

    Args:
        jpeg: Bytes.
        encoding: Encoding name wanted.
        least: Width and height that are enough: a larger picture is decoded at the smallest of
            libjpeg's scales, in eighths, that has them, in a fraction of the time. 0 for all.

    Raises:
        PayloadError: ``corrupt``, in libjpeg's words. A flaw that libjpeg could paper over
            counts too, since a wrong picture would pass for a right one.
    """
    try:
        pixels = simplejpeg.decode_jpeg(
            jpeg, ENCODINGS[encoding].jpeg, min_width=least[0], min_height=least[1]
        )
    except ValueError as error:
        raise PayloadError("corrupt", str(error)) from None
    return pixels[:, :, 0] if pixels.shape[2] == 1 else pixels  # type: ignore[no-any-return]


def encode_png(pixels: Pixels, *, bilevel: bool = False) -> bytes:
    """Return pixels as a PNG, fast rather than small.

    Args:
        pixels: (height, width[, 3 or 4 in BGR order]) uint8 or uint16.
        bilevel: All pixels are 0 or 255: one bit each, a fifth of the time.
    """
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1]
    if bilevel:
        options += [cv2.IMWRITE_PNG_BILEVEL, 1]
    done, buffer = cv2.imencode(".png", pixels, options)
    if not done:
        raise ValueError(f"no PNG can be made of {pixels.dtype} pixels of shape {pixels.shape}")
    return buffer.tobytes()


def decode_png(png: bytes) -> Pixels:
    """Return the pixels of a PNG as they stand in it: (height, width[, channels]).

    Raises:
        PayloadError: ``corrupt``. Every chunk's checksum is verified first, since OpenCV
            hands over what it could read of a broken file without a word.
    """
    position = len(PNG_START)
    kind = b""
    while kind != b"IEND":
        head = png[position : position + 8]
        if len(head) < 8:
            raise PayloadError("corrupt", "the PNG is truncated")
        length, kind = struct.unpack(">I4s", head)
        body_end = position + 8 + length
        checksum = png[body_end : body_end + 4]
        if len(checksum) < 4 or zlib.crc32(png[position + 4 : body_end]) != int.from_bytes(
            checksum
        ):
            raise PayloadError("corrupt", f"wrong checksum in the PNG's chunk {kind!r}")
        if kind in ANIMATION_CHUNKS:
            raise PayloadError("corrupt", "an animated PNG")
        position = body_end + 4
    try:
        pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise PayloadError("corrupt", f"the PNG cannot be decoded: {error.err}") from None
    if pixels is None:
        raise PayloadError("corrupt", "the PNG cannot be decoded")
    return pixels  # type: ignore[return-value]


def picture_size(picture: bytes) -> tuple[int, int]:
    """Return width and height that a JPEG's or PNG's own header states, without decoding.

    Raises:
        PayloadError: ``empty``, ``too_large`` (bytes or pixels), ``not_an_image``, ``corrupt``.
    """
    if not picture:
        raise PayloadError("empty", "no bytes")
    if len(picture) > MAX_COMPRESSED_BYTES:
        raise PayloadError("too_large", f"{len(picture)} bytes, at most {MAX_COMPRESSED_BYTES}")
    if picture.startswith(JPEG_START):
        try:
            height, width, *_ = simplejpeg.decode_jpeg_header(picture)
        except ValueError as error:
            raise PayloadError("corrupt", str(error)) from None
    elif picture.startswith(PNG_START) and picture[12:16] == b"IHDR" and len(picture) > 24:
        width, height = struct.unpack(">II", picture[16:24])
    else:
        raise PayloadError("not_an_image", f"neither JPEG nor PNG, starts with {picture[:8]!r}")
    if not 0 < width * height <= MAX_PIXELS:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {MAX_PIXELS} in all")
    return width, height


def raw_size(encoding: str | None, width: int, height: int) -> int:
    """Return how many bytes raw pixels of this encoding and size are.

    Raises:
        PayloadError: ``unsupported_encoding``, or ``too_large``.
    """
    known = encoding_named(encoding)
    if width * height > MAX_PIXELS:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {MAX_PIXELS} in all")
    return width * height * known.channels * known.dtype.itemsize


def to_raw(pixels: Pixels, encoding: str) -> bytes:
    """Return pixel rows without padding, 16-bit values little-endian."""
    return np.ascontiguousarray(pixels, ENCODINGS[encoding].dtype).tobytes()


def from_raw(raw: bytes, encoding: str, width: int, height: int) -> Pixels:
    """Return raw bytes as a read-only array (height, width[, channels]).

    Raises:
        PayloadError: ``wrong_size`` if the byte count does not fit.
    """
    expected = raw_size(encoding, width, height)
    if len(raw) != expected:
        raise PayloadError(
            "wrong_size", f"{len(raw)} bytes, {width}x{height} {encoding} has {expected}"
        )
    known = ENCODINGS[encoding]
    shape = (height, width) if known.channels == 1 else (height, width, known.channels)
    return np.frombuffer(raw, known.dtype).reshape(shape)
