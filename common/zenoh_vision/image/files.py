"""Image files: which files of a folder are images, their order, and their pictures."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from zenoh_vision.errors import SourceError
from zenoh_vision.image import codecs, depth
from zenoh_vision.image.exif import orientation_of, upright
from zenoh_vision.image.picture import PixelPicture

IMAGE_EXTENSIONS: Final = ("png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "pgm", "ppm")


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


def decoded(data: bytes) -> PixelPicture:
    """Return the contents of an image file, upright, as pixels.

    Grey images keep 16 bits, and images of floats are depth in metres; 16-bit colour is scaled to
    8 bits (x 255 / 65535, rounded). A PNG whose checksums are wrong is refused, as OpenCV would
    return the readable part of it.

    Raises:
        ValueError, PayloadError: It is not an image, or is damaged or unsupported.
    """
    pixels = codecs.decode_png(data) if data.startswith(codecs.PNG_START) else _pixels(data)
    if not data.startswith(codecs.JPEG_START):  # which OpenCV has turned
        pixels = upright(pixels, orientation_of(data))
    if pixels.ndim == 3 and pixels.dtype == np.uint16:
        pixels = depth.eight_bits(pixels)
    is_metres = pixels.ndim == 2 and pixels.dtype == np.float32
    return PixelPicture(pixels, "32FC1" if is_metres else None)


def _pixels(data: bytes) -> Any:
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
    return pixels
