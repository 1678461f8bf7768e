"""The images of a folder, one after the other."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from common import images
from common.errors import PayloadError, SourceError
from services.camera.sources import IMAGE_EXTENSIONS
from services.camera.sources.base import Picture, Pixels
from services.camera.sources.exif import UPRIGHT, orientation
from services.camera.sources.mjpeg import whole_jpeg

log = logging.getLogger(__name__)

ENCODINGS: Final = {
    (1, np.dtype(np.uint8)): "mono8",
    (1, np.dtype(np.uint16)): "mono16",
    (3, np.dtype(np.uint8)): "bgr8",
    (4, np.dtype(np.uint8)): "bgra8",
}


class FolderSource:
    """The images of a folder in natural order (``frame2`` before ``frame10``), once.

    JPEG files come through undecoded. Grey images stay grey with their depth; colour of 16
    bits is scaled to 8 (x 255 / 65535, rounded). An image that cannot be read is left out
    with a warning.

    Args:
        path: A folder, or a single image.
        rate_hz: Images per second.

    Raises:
        SourceError: There is no such folder, no image in it, or none that can be read.
    """

    live = False

    def __init__(self, path: Path | str, *, rate_hz: float = 10.0) -> None:
        self._path = Path(path)
        self._files = images_in(self._path)
        self.rate_hz: float | None = rate_hz
        self._next_file = 0
        self._given = 0
        # One that can be read now tells a folder of images from one that only looks like it.
        self._first = self._next_picture()
        if self._first is None:
            raise SourceError(f"{self._path}: none of its {len(self._files)} images can be read")
        what = "folder" if self._path.is_dir() else "image"
        self.description = (
            f"{what} {self._path.name} ({len(self._files)} images, "
            f"{self._first.width}x{self._first.height}, {rate_hz:g} Hz)"
        )

    def read(self) -> Picture | None:
        """Return the next image, or None after the last one."""
        picture, self._first = self._first, None
        return picture or self._next_picture()

    def close(self) -> None:
        """Forget the images that are left; safe to call twice."""
        self._first = None
        self._next_file = len(self._files)

    def _next_picture(self) -> Picture | None:
        while self._next_file < len(self._files):
            file = self._files[self._next_file]
            self._next_file += 1
            try:
                picture = _picture(file.read_bytes(), self._given / (self.rate_hz or 1.0))
            except (OSError, ValueError, PayloadError) as error:
                log.warning("%s: left out: %s", file, error)
                continue
            self._given += 1
            return picture
        return None


def images_in(path: Path) -> list[Path]:
    """Return the images of a folder in natural order; a path that is an image stands alone.

    Raises:
        SourceError: There is no such folder, it may not be read, or it holds no image.
    """
    try:
        if path.is_file():
            return [path]
        files = [file for file in path.iterdir() if is_image(file) and file.is_file()]
    except FileNotFoundError:
        raise SourceError(f"{path}: no such folder") from None
    except OSError as error:
        raise SourceError(f"{path}: the folder cannot be read: {error.strerror}") from None
    if not files:
        raise SourceError(f"{path}: no image in this folder ({', '.join(IMAGE_EXTENSIONS)})")
    return sorted(files, key=lambda file: natural_key(file.name))


def is_image(path: Path) -> bool:
    """Tell whether a name is that of an image; hidden files are none."""
    return path.suffix[1:].lower() in IMAGE_EXTENSIONS and not path.name.startswith(".")


def natural_key(name: str) -> tuple[list[tuple[int, int | str]], str]:
    """Return what sorts names as people count: digits as numbers, letters whatever their case."""
    parts = re.findall(r"([0-9]+)|([^0-9]+)", name)
    counted = [(0, int(digits)) if digits else (1, text.casefold()) for digits, text in parts]
    return counted, name


def _picture(data: bytes, due_s: float) -> Picture:
    """Return the image that the bytes of a file are.

    Raises:
        ValueError, PayloadError: They are none, or a damaged or unsupported one.
    """
    if data.startswith((images.JPEG_START, images.PNG_START)):
        images.picture_size(data)
    if data.startswith(images.JPEG_START):
        jpeg = whole_jpeg(data)
        if jpeg is not None and orientation(jpeg.data) == UPRIGHT:
            return Picture(jpeg.encoding, jpeg.width, jpeg.height, jpeg=jpeg.data, due_s=due_s)
    pixels = _decode(data)
    if pixels.ndim == 3 and pixels.dtype == np.uint16:
        pixels = images.eight_bits(pixels)
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    encoding = ENCODINGS.get((channels, pixels.dtype))
    if encoding is None:
        raise ValueError(f"{channels} channels of {pixels.dtype} are not supported")
    return Picture(encoding, pixels.shape[1], pixels.shape[0], pixels=pixels, due_s=due_s)


def _decode(data: bytes) -> Pixels:
    if data.startswith(images.PNG_START):
        return images.decode_png(data)
    # UNCHANGED keeps alpha, but heeds no Exif orientation; a JPEG has no alpha.
    upright = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR
    flags = upright if data.startswith(images.JPEG_START) else cv2.IMREAD_UNCHANGED
    if not data:
        raise ValueError("the file is empty")
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise ValueError(f"OpenCV: {error.err}") from None
    if pixels is None:
        raise ValueError("not an image that can be decoded")
    return pixels  # type: ignore[return-value]  # other depths are refused by the caller
