"""Checks the packets of MJPEG sources, and makes complete, upright JPEGs of them.

Some cameras omit the Huffman tables, which are then those of ITU-T T.81 Annex K.3; some pad the
packets; errors on the bus truncate packets.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import simplejpeg

from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs
from zenoh_vision.image.exif import UPRIGHT, orientation_of
from zenoh_vision.image.files import decoded
from zenoh_vision.image.picture import JpegPicture, Picture

START_OF_IMAGE: Final = b"\xff\xd8"
END_OF_IMAGE: Final = b"\xff\xd9"
DHT: Final = 0xC4
SOS: Final = 0xDA
APP0: Final = 0xE0
BASELINE: Final = (0xC0, 0xC1)
PROGRESSIVE: Final = 0xC2
FRAME_HEADERS: Final = frozenset(range(0xC0, 0xD0)) - {DHT, 0xC8, 0xCC}
STANDALONE: Final = frozenset({0x01, *range(0xD0, 0xDA)})
"""Markers without a length; none of them is allowed in a header."""

Segment = tuple[int, int, bytes]
"""A segment of a header: its marker, its offset in the packet, and its body."""

_JPEG = simplejpeg.encode_jpeg(np.zeros((8, 8, 3), np.uint8))
STANDARD_HUFFMAN_TABLES: Final[bytes] = _JPEG[_JPEG.index(b"\xff\xc4") : _JPEG.index(b"\xff\xda")]
"""The DHT segments of T.81 tables K.3 to K.6, which libjpeg writes unless told to optimize."""


class DamagedJpeg(ValueError):
    """A packet is not a whole JPEG; the text says what is wrong."""


def upright_jpeg(packet: bytes) -> Picture | None:
    """Return the JPEG in a packet as a picture that is upright, as its Exif data says.

    It is passed on as it is unless it must be turned; otherwise as for ``whole_jpeg``.

    Raises:
        DamagedJpeg: As for ``whole_jpeg``.
    """
    jpeg = whole_jpeg(packet)
    if jpeg is None or orientation_of(jpeg.data) == UPRIGHT:
        return jpeg
    try:
        return decoded(jpeg.data)
    except (ValueError, PayloadError) as error:
        raise DamagedJpeg(str(error)) from None


def upright_picture(file: bytes) -> Picture:
    """Return an image file as a picture that is upright; a JPEG as for ``upright_jpeg``.

    Raises:
        ValueError, PayloadError: It is no image, or is damaged, too large or unsupported.
    """
    is_jpeg = file.startswith(codecs.JPEG_START)
    if is_jpeg or file.startswith(codecs.PNG_START):
        codecs.picture_size(file)  # refuses what is too large before it is decoded
    jpeg = upright_jpeg(file) if is_jpeg else None
    return decoded(file) if jpeg is None else jpeg


def whole_jpeg(packet: bytes) -> JpegPicture | None:
    """Return the JPEG in a packet as a picture, trimmed and made complete.

    Args:
        packet: As the source sent it; bytes before and after the JPEG are removed.

    Returns:
        A picture with a JPEG that every reader decodes, to ``mono8`` or ``bgr8``; None if the
        JPEG is whole, but of a kind that many readers refuse: two fields instead of one
        picture, lossless, arithmetic, 12 bits, CMYK.

    Raises:
        DamagedJpeg: The packet holds no JPEG, only a part of one, or one with too many scans.
    """
    start = packet.find(START_OF_IMAGE + b"\xff")
    if start < 0:
        raise DamagedJpeg("no JPEG")
    header = list(_segments(packet, start + len(START_OF_IMAGE)))
    frames = [(marker, body) for marker, _, body in header if marker in FRAME_HEADERS]
    if not frames:
        raise DamagedJpeg("no frame header")
    if any(len(body) < 6 for _, body in frames):
        raise DamagedJpeg("a frame header that is too short")
    scan = header[-1][1]
    # Coded data never contains this pair; tables between scans could, but only in theory.
    end = packet.find(END_OF_IMAGE, scan)
    if end < 0:
        raise DamagedJpeg("cut short: it has no end")
    end += len(END_OF_IMAGE)
    frame_marker, frame = frames[-1]
    precision, components = frame[0], frame[5]
    height, width = int.from_bytes(frame[1:3], "big"), int.from_bytes(frame[3:5], "big")
    common = frame_marker in (*BASELINE, PROGRESSIVE) and precision == 8
    if not common or components not in (1, 3) or not height or _is_field(header):
        return None
    try:
        codecs.check_scans(packet[start:end] if start else packet)
    except PayloadError as error:
        raise DamagedJpeg(error.detail) from None
    if any(marker == DHT for marker, _, _ in header):
        jpeg = packet if (start, end) == (0, len(packet)) else packet[start:end]
    elif frame_marker in BASELINE:
        jpeg = packet[start:scan] + STANDARD_HUFFMAN_TABLES + packet[scan:end]
    else:
        raise DamagedJpeg("a progressive JPEG without Huffman tables")
    encoding = "mono8" if components == 1 else "bgr8"
    # Flaws that libjpeg can repair are accepted in a webcam's JPEG.
    return JpegPicture(jpeg, encoding, (width, height), strict=False)


def _is_field(header: list[Segment]) -> bool:
    """Tell whether a JPEG is one field of an interlaced picture, as AVI files mark it."""
    marks = [body[4:5] for marker, _, body in header if marker == APP0 and body[:4] == b"AVI1"]
    return any(mark not in (b"", b"\0") for mark in marks)


def _segments(packet: bytes, offset: int) -> Iterator[Segment]:
    """Yield the segments from an offset up to the start of the scan."""
    marker = 0
    while marker != SOS:
        first = offset
        while packet[offset : offset + 1] == b"\xff":  # any number of fill bytes is allowed
            offset += 1
        marker = packet[offset] if first < offset < len(packet) else 0
        if marker == 0 or marker in STANDALONE:
            raise DamagedJpeg(f"no marker at byte {first}")
        body = offset + 3
        offset += 1 + int.from_bytes(packet[offset + 1 : body], "big")
        if not body <= offset <= len(packet):
            raise DamagedJpeg("cut short in its header")
        yield marker, first, packet[body:offset]
