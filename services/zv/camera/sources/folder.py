"""The images of a folder, one after the other."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.pixel_formats import Pixels
from zv.camera.sources.base import Picture, picture_of
from zv.camera.sources.kinds import IMAGE_EXTENSIONS, names_image
from zv.camera.sources.mjpeg import whole_jpeg

log = logging.getLogger(__name__)

TURNED: Final = re.compile(
    rb"\xff\xe1..Exif\0\0"
    rb"(?:II.{,800}?\x12\x01\x03\0....[\x02-\x08]\0|MM.{,800}?\x01\x12\0\x03....\0[\x02-\x08])",
    re.DOTALL,
)
"""An Exif orientation that is not upright: tag 0x0112, a short of 2 to 8, in either byte order."""

EXIF_BYTES: Final = 1 << 16
"""Length of a JPEG's start in which its Exif segment is looked for."""


class FolderSource:
    """The images of a folder in natural order (``frame2`` before ``frame10``), once.

    JPEG files are passed on undecoded. Grey images keep their depth; 16-bit colour is scaled to
    8 bits (x 255 / 65535, rounded). An image that cannot be read is skipped with a warning.

    Args:
        path: A folder, or a single image.
        rate_hz: Images per second.

    Raises:
        SourceError: The folder does not exist, or has no readable image.
    """

    live = False

    def __init__(self, path: Path | str, *, rate_hz: float = 10.0) -> None:
        path = Path(path)
        files = images_in(path)
        pictures = _pictures(files, rate_hz)
        # Refuse a folder without a readable image here, not at the first ``read``.
        first = next(pictures, None)
        if first is None:
            raise SourceError(f"{path}: none of its {len(files)} images can be read")
        self._pictures = chain([first], pictures)
        self.rate_hz: float | None = rate_hz
        self.description = (
            f"{'folder' if path.is_dir() else 'image'} {path.name} "
            f"({len(files)} images, {first.width}x{first.height}, {rate_hz:g} Hz)"
        )

    def read(self) -> Picture | None:
        """Return the next image, or None after the last one."""
        return next(self._pictures, None)

    def close(self) -> None:
        """Skip the images that are left."""
        self._pictures = chain()


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


def _pictures(files: list[Path], rate_hz: float) -> Iterator[Picture]:
    count = 0
    for file in files:
        try:
            picture = _picture(file.read_bytes())
        except (OSError, ValueError, PayloadError) as error:
            log.warning("%s: skipped: %s", file, error)
        else:
            yield replace(picture, due_s=count / rate_hz)
            count += 1


def _picture(data: bytes) -> Picture:
    """Return the contents of an image file as a picture.

    Raises:
        ValueError, PayloadError: It is not an image, or is damaged or unsupported.
    """
    if data.startswith((codecs.JPEG_START, codecs.PNG_START)):
        codecs.picture_size(data)
    if data.startswith(codecs.JPEG_START):
        jpeg = whole_jpeg(data)
        if jpeg is not None and not TURNED.search(data, 0, EXIF_BYTES):
            return jpeg
    pixels = _decode(data)
    if pixels.ndim == 3 and pixels.dtype == np.uint16:
        pixels = pixel_formats.eight_bits(pixels)
    return picture_of(pixels)


def _decode(data: bytes) -> Pixels:
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
