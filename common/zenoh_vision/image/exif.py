"""How a camera was held, by the Exif data of an image file; and turning pixels upright.

The tag 0x0112 of Exif 2.3 has one of 8 values. It is in the segment APP1 of a JPEG, the chunk eXIf
of a PNG, and the chunk EXIF of a WebP.

The pixels of a stream count as they are stored: those are what a decoder returns, what a header's
width and height say, and what all coordinates count in. A browser would turn the picture under its
boxes, so whoever passes a JPEG on to one takes the orientation out.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Final

import cv2

from zenoh_vision.image.pixel_formats import Pixels

UPRIGHT: Final = 1
MAX_SEGMENTS: Final = 32
MAX_ENTRIES: Final = 200
_TAG: Final = 0x0112
_SHORT: Final = 3
_HEAD: Final = b"Exif\0\0"
_JPEG_START: Final = b"\xff\xd8"

_STEPS: Final[dict[int, tuple[int | None, int | None]]] = {
    2: (None, 1),
    3: (cv2.ROTATE_180, None),
    4: (None, 0),
    5: (cv2.ROTATE_90_CLOCKWISE, 1),
    6: (cv2.ROTATE_90_CLOCKWISE, None),
    7: (cv2.ROTATE_90_COUNTERCLOCKWISE, 1),
    8: (cv2.ROTATE_90_COUNTERCLOCKWISE, None),
}
"""Rotation, then flip, that make a picture with each orientation upright, as for OpenCV."""


def orientation_of(file: bytes) -> int:
    """Return the Exif orientation of an image file, 1 to 8; 1 if it states none."""
    values = (struct.unpack_from(f"{order}H", file, at)[0] for at, order in _orientations(file))
    return next((value for value in values if 1 <= value <= 8), UPRIGHT)


def as_stored(jpeg: bytes) -> bytes:
    """Return a JPEG without an orientation; the same bytes if it has none, or a damaged one."""
    found = _orientations(jpeg) if jpeg.startswith(_JPEG_START) else ()
    for at, order in found:
        upright = struct.pack(f"{order}H", UPRIGHT)
        if jpeg[at : at + 2] != upright:
            jpeg = jpeg[:at] + upright + jpeg[at + 2 :]
    return jpeg


def upright(pixels: Pixels, orientation: int) -> Pixels:
    """Return stored pixels as they are to be shown; the same if they are upright already."""
    if orientation not in _STEPS:
        return pixels
    rotation, flip = _STEPS[orientation]
    turned = pixels if rotation is None else cv2.rotate(pixels, rotation)
    return turned if flip is None else cv2.flip(turned, flip)  # type: ignore[return-value]


def _orientations(file: bytes) -> Iterator[tuple[int, str]]:
    """Yield where a file states its orientation, and in which byte order."""
    for begin, end in _exif_blocks(file):
        order = {b"II*\0": "<", b"MM\0*": ">"}.get(file[begin : begin + 4])
        if order is None or begin + 8 > end:
            continue
        place = begin + struct.unpack_from(f"{order}I", file, begin + 4)[0]
        if place + 2 > end:
            continue
        (count,) = struct.unpack_from(f"{order}H", file, place)
        for entry in range(place + 2, place + 2 + 12 * min(count, MAX_ENTRIES), 12):
            if entry + 12 > end:
                break
            if struct.unpack_from(f"{order}HH", file, entry) == (_TAG, _SHORT):
                yield entry + 8, order
                break


def _exif_blocks(file: bytes) -> Iterator[tuple[int, int]]:
    """Yield where the Exif data of a file begin, with their TIFF header, and end."""
    blocks: Iterator[tuple[bytes, int, int]] = iter(())
    if file.startswith(_JPEG_START):
        blocks = _segments(file)
    elif file.startswith(b"\x89PNG"):
        blocks = _chunks(file, 8, ">I4s", kind_first=False)
    elif file.startswith(b"RIFF") and file[8:12] == b"WEBP":
        blocks = _chunks(file, 12, "<4sI", kind_first=True)
    for kind, begin, end in blocks:
        has_head = file.startswith(_HEAD, begin)
        if kind in (b"eXIf", b"EXIF") or (kind == b"\xe1" and has_head):
            yield begin + len(_HEAD) * has_head, min(end, len(file))


def _segments(jpeg: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield marker, begin and end of the first segments of a JPEG, those before its pixels."""
    position = 2
    for _ in range(MAX_SEGMENTS):
        head = jpeg[position : position + 4]
        if head[:2] == b"\xff\xff":  # a fill byte
            position += 1
            continue
        length = int.from_bytes(head[2:])
        if len(head) < 4 or head[0] != 0xFF or head[1] in (0xDA, 0xD9) or length < 2:
            return
        yield head[1:2], position + 4, position + 2 + length
        position += 2 + length


def _chunks(
    file: bytes, position: int, layout: str, *, kind_first: bool
) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, begin and end of the chunks of a PNG, or of a WebP, where they are even."""
    while position + 8 <= len(file):
        first, second = struct.unpack_from(layout, file, position)
        kind, length = (first, second) if kind_first else (second, first)
        yield kind, position + 8, position + 8 + length
        position += 8 + length + (length % 2 if kind_first else 4)
