"""JPEG and PNG to arrays and back, and a picture's size without decoding it."""

from __future__ import annotations

import re
import struct
import zlib
from collections import deque
from collections.abc import Callable
from typing import Final

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image import bands
from zenoh_vision.image.limits import MAX_PIXELS
from zenoh_vision.image.pixel_formats import ENCODINGS, Pixels
from zenoh_vision.keys import JPEG, PNG

MAX_COMPRESSED_BYTES: Final = 32 << 20
JPEG_START: Final = b"\xff\xd8\xff"
PNG_START: Final = b"\x89PNG\r\n\x1a\n"
PNG_HEAD: Final = 26
"""Length of a PNG's start that includes its bit depth and colour type, bytes."""

ANIMATION_CHUNKS: Final = (b"acTL", b"fcTL", b"fdAT")
"""Chunks of an animated PNG, which no camera sends; malformed ones crash OpenCV 5.0 (SIGSEGV)."""

MAX_SCANS: Final = 100
MAX_SCAN_PIXELS: Final = 16 * MAX_PIXELS
"""Pixels times scans. A scan costs time for each pixel even if it is empty and has 53 bytes. A JPEG
usually has 1 scan, a progressive one 10 to 14."""

_MARKER: Final = re.compile(rb"\xff([^\x00\x01\xd0-\xd7\xff])")
"""A marker with a segment after it: neither a stuffed or filling byte, nor TEM or RST."""
_SKIPPED: Final = re.compile("([0-9]+) extraneous bytes before marker 0x(d[0-9])")
"""What libjpeg says of bytes between the coded data and the marker after it."""
_MAX_PADDING: Final = 16
"""Most bytes before a restart marker that are taken for padding; webcams send 1 to 8."""
_START_OF_IMAGE, _END_OF_IMAGE, _START_OF_SCAN = 0xD8, 0xD9, 0xDA
_FRAME_HEADERS: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}

MAX_KNOWN: Final = 8
MAX_KNOWN_BYTES: Final = 4096
_known_heads: deque[tuple[bytes, tuple[int, int]]] = deque(maxlen=MAX_KNOWN)
"""Sizes of the last checked JPEGs, by their bytes up to the coded data. The checks depend only on
these bytes, which are the same in all pictures of a camera."""


def picture_type(picture: bytes) -> str | None:
    """Return the Zenoh encoding of a JPEG or PNG by its first bytes; None if it is neither."""
    if picture.startswith(JPEG_START):
        return JPEG
    return PNG if picture.startswith(PNG_START) else None


def encode_jpeg(pixels: Pixels, encoding: str, quality: int) -> bytes:
    """Return 8-bit pixels as a JPEG (4:2:0, or grey for ``mono8``); alpha is left out.

    Args:
        pixels: (height, width[, channels]) uint8.
        encoding: Encoding name of ``pixels``, one of 8 bits.
        quality: 1 to 100.
    """
    array = np.ascontiguousarray(pixels if pixels.ndim == 3 else pixels[:, :, np.newaxis])
    space = ENCODINGS[encoding].space
    sampling, mcu = ("Gray", 8) if space == "GRAY" else ("420", 16)

    def encode_rows(rows: slice) -> bytes:
        jpeg: bytes = simplejpeg.encode_jpeg(array[rows], quality, space, sampling)
        return jpeg

    height, width = array.shape[:2]
    return bands.encode(width, height, encode_rows, mcu)


def decode_jpeg(
    jpeg: bytes,
    encoding: str,
    least: tuple[int, int] = (0, 0),
    *,
    strict: bool = True,
    target: NDArray[np.uint8] | None = None,
    skipped: Callable[[], object] = lambda: None,
) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG in an 8-bit encoding.

    Args:
        jpeg: The file.
        encoding: Encoding name wanted.
        least: Width and height that suffice: a larger picture is decoded at the smallest of
            libjpeg's scales, multiples of 1/8, that has them, which is faster. 0 for full size.
        strict: Whether a flaw that libjpeg could repair is an error too, so that a damaged
            picture is not taken for an intact one. Padding is no damage: some cameras send
            zeros before the end, or a few bytes before a restart marker.
        target: Memory of the size of the pixels, to which they are written.
        skipped: Called if there is padding in a picture that is decoded strictly.

    Raises:
        PayloadError: ``corrupt``, in libjpeg's words, or ``too_large``: too many scans.
    """
    size = _known_size(jpeg)
    if size is None:
        check_scans(jpeg)
    try:
        is_small = size is not None and size[0] * size[1] < 2 * bands.BAND_PIXELS
        layout = None if is_small else bands.layout(jpeg)
        pixels = None
        if layout is not None:
            pixels = _decode_bands(jpeg, layout, encoding, least, target, strict=strict)
        if pixels is None:
            pixels = simplejpeg.decode_jpeg(
                jpeg,
                ENCODINGS[encoding].space,
                min_width=least[0],
                min_height=least[1],
                strict=strict,
                buffer=target,
            )
    except ValueError as error:
        if not strict or not _is_padding(jpeg, str(error)):
            raise PayloadError("corrupt", str(error)) from None
        skipped()
        return decode_jpeg(jpeg, encoding, least, strict=False, target=target)
    return pixels[:, :, 0] if pixels.shape[2] == 1 else pixels


def _is_padding(jpeg: bytes, words: str) -> bool:
    """Tell whether libjpeg complains only of padding, which belongs to no picture."""
    found = _SKIPPED.search(words)
    if found is None:
        return False
    count, marker = int(found[1]), int(found[2], 16)
    if marker != _END_OF_IMAGE:
        return count <= _MAX_PADDING
    end = jpeg.rfind(bytes([0xFF, _END_OF_IMAGE]))
    return count <= end and not any(jpeg[end - count : end])


def _decode_bands(
    jpeg: bytes,
    layout: bands.Layout,
    encoding: str,
    least: tuple[int, int],
    target: NDArray[np.uint8] | None,
    *,
    strict: bool,
) -> NDArray[np.uint8] | None:
    """Return the pixels of a JPEG in bands, (height, width, channels).

    None if its bands are not complete, or if a smaller scale has the size too.

    Raises:
        ValueError: A band is corrupt.
    """
    next_smaller = -(-layout.width * 7 // 8), -(-layout.height * 7 // 8)
    if any(least) and next_smaller[0] >= least[0] and next_smaller[1] >= least[1]:
        return None
    known = ENCODINGS[encoding]
    shape = (layout.height, layout.width, known.channels)
    pixels = np.empty(shape, np.uint8) if target is None else target.reshape(shape)

    def decode_rows(band: bytes, rows: slice) -> None:
        simplejpeg.decode_jpeg(band, known.space, strict=strict, buffer=pixels[rows])

    return pixels if bands.decode(jpeg, layout, decode_rows) else None


def check_scans(jpeg: bytes) -> int | None:
    """Check the number of a JPEG's scans, times its pixels, by its segments, without decoding.

    It costs microseconds, as the coded data is searched only if several scans are possible.

    Returns:
        The offset at which the header of its only scan ends, where the check ends too; None if
        several scans are possible.

    Raises:
        PayloadError: ``too_large``.
    """
    position = scans = pixels = components = 0
    sequential = False
    while found := _MARKER.search(jpeg, position):
        marker, start = found[1][0], found.end()
        if marker == _END_OF_IMAGE:
            return None
        body = jpeg[start + 2 : start + 8]
        if marker in _FRAME_HEADERS and len(body) == 6:
            height, width, components = struct.unpack(">xHHB", body)
            pixels = width * height
            sequential = marker in (0xC0, 0xC1)
        elif marker == _START_OF_SCAN:
            scans += 1
            if scans == 1 and sequential and body[:1] == bytes([components]):
                # This scan holds all components, so libjpeg reads no other.
                return start + int.from_bytes(jpeg[start : start + 2])
            if scans > MAX_SCANS or scans * pixels > MAX_SCAN_PIXELS:
                most = min(MAX_SCANS, MAX_SCAN_PIXELS // max(1, pixels))
                raise PayloadError("too_large", f"a JPEG of over {most} scans of {pixels} pixels")
        position = start
        if marker != _START_OF_IMAGE:
            position += max(2, int.from_bytes(jpeg[start : start + 2]))
    return None


def encode_png(pixels: Pixels, *, bilevel: bool = False) -> bytes:
    """Return pixels as a PNG, fast rather than small.

    Args:
        pixels: (height, width[, 3 or 4 in BGR order]) uint8 or uint16.
        bilevel: All pixels are 0 or 255: one bit each, a fifth of the time.
    """
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_BILEVEL, int(bilevel)]
    done, buffer = cv2.imencode(".png", pixels, options)
    if not done:
        raise ValueError(f"no PNG can be made of {pixels.dtype} pixels of shape {pixels.shape}")
    return buffer.tobytes()


def decode_png(png: bytes) -> Pixels:
    """Return the pixels of a PNG as stored: (height, width[, channels]).

    Raises:
        PayloadError: ``corrupt``. Every chunk's checksum is verified first, since OpenCV
            returns the readable part of a broken file without an error.
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


def is_deep_png(picture: bytes) -> bool:
    """Tell whether a picture is a PNG of 16 bits per pixel, grey, by its header."""
    return (
        picture.startswith(PNG_START)
        and picture[12:16] == b"IHDR"
        and (picture[24:26] == b"\x10\0")
    )


def stored_encoding(picture: bytes) -> str:
    """Return the encoding of a picture that comes without one: ``mono16`` or ``bgr8``."""
    return "mono16" if is_deep_png(picture) else "bgr8"


def picture_size(picture: bytes) -> tuple[int, int]:
    """Return width and height that a JPEG's or PNG's own header states, without decoding.

    Raises:
        PayloadError: ``empty``, ``too_large`` (bytes, pixels or scans), ``not_an_image``,
            ``unsupported_encoding``, ``corrupt``.
    """
    if not picture:
        raise PayloadError("empty", "no bytes")
    if len(picture) > MAX_COMPRESSED_BYTES:
        raise PayloadError("too_large", f"{len(picture)} bytes, at most {MAX_COMPRESSED_BYTES}")
    if (known := _known_size(picture)) is not None:
        return known
    head_end = None
    if picture.startswith(JPEG_START):
        try:
            height, width, *_ = simplejpeg.decode_jpeg_header(picture)
        except ValueError as error:
            raise PayloadError("corrupt", str(error)) from None
        except KeyError as error:  # 4:4:1, which simplejpeg 1.9 does not know
            raise PayloadError(
                "unsupported_encoding", f"a JPEG of chroma subsampling {error}"
            ) from None
        head_end = check_scans(picture)
    elif picture.startswith(PNG_START) and picture[12:16] == b"IHDR" and len(picture) > 24:
        width, height = struct.unpack(">II", picture[16:24])
    else:
        raise PayloadError("not_an_image", f"neither JPEG nor PNG, starts with {picture[:8]!r}")
    if not 0 < width * height <= MAX_PIXELS:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {MAX_PIXELS} in all")
    if head_end is not None and head_end <= MAX_KNOWN_BYTES:
        _known_heads.appendleft((picture[:head_end], (width, height)))
    return width, height


def _known_size(picture: bytes) -> tuple[int, int] | None:
    """Return the size of a JPEG that begins exactly as one that was checked; else None."""
    for head, size in tuple(_known_heads):  # a copy, since other threads may add to it
        if picture.startswith(head):
            return size
    return None
