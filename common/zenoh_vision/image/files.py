"""Image files: which files of a folder are images, their order, and their pixels."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from zenoh_vision.errors import SourceError
from zenoh_vision.image import codecs
from zenoh_vision.image.pixel_formats import Pixels

IMAGE_EXTENSIONS: Final = ("png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "pgm", "ppm")


TURNED: Final = re.compile(
    rb"\xff\xe1..Exif\0\0"
    rb"(?:II.{,800}?\x12\x01\x03\0....[\x02-\x08]\0|MM.{,800}?\x01\x12\0\x03....\0[\x02-\x08])",
    re.DOTALL,
)
"""An Exif orientation that is not upright: tag 0x0112, a short of 2 to 8, in either byte order."""

EXIF_BYTES: Final = 1 << 16
"""Length of a JPEG's start in which its Exif segment is looked for."""


def is_turned(jpeg: bytes) -> bool:
    """Tell whether a JPEG must be turned or mirrored to be upright."""
    return TURNED.search(jpeg, 0, EXIF_BYTES) is not None


def names_image(path: Path) -> bool:
    """Tell whether a file is an image by its extension."""
    return path.suffix[1:].lower() in IMAGE_EXTENSIONS


def images_in(path: Path) -> list[Path]:
    """Return the images of a folder in natural order, or the path itself if it is an image.

    Raises:
        SourceError: The folder does not exist, cannot be read, or has no image.
    """
    try:
        if path.is_file():
            return [path]
        files = [
            file
            for file in path.iterdir()
            if names_image(file) and not file.name.startswith(".") and file.is_file()
        ]
    except OSError as error:
        raise SourceError(f"{path}: the folder cannot be read: {error.strerror}") from None
    if not files:
        raise SourceError(f"{path}: no image in this folder ({', '.join(IMAGE_EXTENSIONS)})")
    return sorted(files, key=_natural_key)


def _natural_key(file: Path) -> tuple[list[str | int], str]:
    """Return a sort key for natural order: digits compare as numbers, letters without case."""
    parts: list[str | int] = list(re.split(r"([0-9]+)", file.name.casefold()))
    parts[1::2] = map(int, parts[1::2])
    return parts, file.name


def decode_image(data: bytes) -> Pixels:
    """Return the pixels of an image file as stored, upright: (height, width[, channels]).

    A PNG whose checksums are wrong is refused, as OpenCV would return the readable part of it.

    Raises:
        ValueError, PayloadError: It is not an image, or is damaged.
    """
    if data.startswith(codecs.PNG_START):
        return codecs.decode_png(data)
    # UNCHANGED keeps alpha, but ignores the Exif orientation; a JPEG has no alpha.
    upright = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR
    flags = upright if data.startswith(codecs.JPEG_START) else cv2.IMREAD_UNCHANGED
    if not data:
        raise ValueError("the file is empty")
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise ValueError(f"OpenCV: {error.err}") from None
    if pixels is None:
        raise ValueError("not an image that can be decoded")
    return pixels  # type: ignore[return-value]  # other depths are refused by the caller
