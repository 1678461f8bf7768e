"""A picture in another form: smaller, turned, as JPEG or PNG. Arrays in, bytes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from common import images
from common.frame import Frame
from common.images import Pixels

MAX_SIDE = 7680


@dataclass(frozen=True, slots=True)
class Form:
    """How a client wants its pictures; without any wish they stay the bytes that they are.

    Attributes:
        width: Pixels; None leaves it, or follows from the height.
        height: Pixels.
        inside: Width and height are a box that the picture is to fit in, never enlarged; else
            they are its size.
        quality: JPEG quality; None for the viewer's own.
        invert: Turned by 180 degrees.
        format: ``jpeg`` or ``png``; None for the one that it has.
    """

    width: int | None = None
    height: int | None = None
    inside: bool = False
    quality: int | None = None
    invert: bool = False
    format: Literal["jpeg", "png"] | None = None

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the size that a picture of this width and height gets, pixels."""
        if self.width is None and self.height is None:
            return width, height
        if self.inside:
            scale = min(1.0, (self.width or width) / width, (self.height or height) / height)
            return max(1, round(width * scale)), max(1, round(height * scale))
        if self.width is None:
            assert self.height is not None
            return max(1, min(MAX_SIDE, round(width * self.height / height))), self.height
        if self.height is None:
            return self.width, max(1, min(MAX_SIDE, round(height * self.width / width)))
        return self.width, self.height

    def leaves(self, mime: str, width: int, height: int) -> bool:
        """Tell whether a picture of this kind and size is what is wanted already."""
        same = self.size(width, height) == (width, height) and not self.invert
        if self.quality is not None and mime == "image/jpeg":
            return False
        return same and self.format in (None, mime.removeprefix("image/"))


def render(frame: Frame, form: Form, quality: int) -> tuple[bytes, str, int, int]:
    """Return a frame's picture in a form: its bytes, MIME type, width and height.

    Args:
        frame: Compressed or raw; 16 bits are scaled to 8 for a JPEG.
        form: What is wanted.
        quality: JPEG quality where the form says none, 1 to 100.

    Raises:
        PayloadError: ``corrupt``: it cannot be decoded.
    """
    header = frame.header
    size = form.size(header.width, header.height)
    as_png = form.format == "png" or (form.format is None and frame.mime == "image/png")
    encoding = header.encoding or "bgr8"
    sixteen = encoding == "mono16" and as_png
    gray = encoding.startswith("mono")
    pixels: Pixels = frame.pixels if sixteen else frame.gray if gray else frame.bgr
    pixels = fitted(pixels, size, invert=form.invert)
    width, height = size
    if as_png:
        return images.encode_png(pixels), "image/png", width, height
    jpeg = images.encode_jpeg(pixels, "mono8" if gray else "bgr8", form.quality or quality)
    return jpeg, "image/jpeg", width, height


def fitted(pixels: Pixels, size: tuple[int, int], *, invert: bool) -> Pixels:
    """Return pixels at a size, width and height, and turned by 180 degrees if so wanted."""
    height, width = pixels.shape[:2]
    if (width, height) != size:
        smaller = size[0] * size[1] < width * height
        how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        resized = cv2.resize(pixels, size, interpolation=how)
        pixels = np.asarray(resized, np.uint16 if pixels.dtype == np.uint16 else np.uint8)
    return np.ascontiguousarray(pixels[::-1, ::-1]) if invert else pixels
