"""A picture in another form: smaller, turned, as JPEG or PNG. Arrays in, bytes out."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal, cast

import cv2
import numpy as np

from common import images
from common.frame import Frame
from common.images import Pixels

MAX_SIDE = 7680
MAX_PIXELS = 4096 * 2304
"""Of what is made larger for a client: memory and time are everybody's."""
DIM = 0.35


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
            return _bounded(width * self.height / height, self.height)
        if self.height is None:
            return _bounded(self.width, height * self.width / width)
        return self.width, self.height

    def leaves(self, mime: str, width: int, height: int) -> bool:
        """Tell whether a picture of this kind and size is what is wanted already."""
        same = self.size(width, height) == (width, height) and not self.invert
        if self.quality is not None and mime == "image/jpeg":
            return False
        return same and self.format in (None, mime.removeprefix("image/"))


def _bounded(width: float, height: float) -> tuple[int, int]:
    """Return a size in its shape, with no more pixels and no longer sides than are allowed."""
    least = min(1.0, (MAX_PIXELS / (width * height)) ** 0.5, MAX_SIDE / width, MAX_SIDE / height)
    return max(1, round(width * least)), max(1, round(height * least))


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
    shown = "mono8" if gray else "bgr8"
    pixels: Pixels = frame.pixels if sixteen else frame.reduced(shown, *size)
    pixels = fitted(pixels, size, invert=form.invert)
    width, height = size
    if as_png:
        return images.encode_png(pixels), "image/png", width, height
    jpeg = images.encode_jpeg(pixels, shown, form.quality or quality)
    return jpeg, "image/jpeg", width, height


def ended(payload: bytes, since_ns: int) -> bytes:
    """Return a stream's last picture as it looks when nothing comes any more: dim, grey, dated.

    Args:
        payload: JPEG or PNG.
        since_ns: When the stream ended, ns since 1970.

    Returns:
        A picture of the same size and kind.

    Raises:
        PayloadError: ``corrupt``: it cannot be decoded.
    """
    width, height = images.picture_size(payload)
    png = payload.startswith(images.PNG_START)
    if png:
        pixels = images.decode_png(payload)
        found = {2: "mono8", 3: "bgr8"}.get(pixels.ndim, "bgr8")
        if pixels.dtype == np.uint16:
            pixels = images.eight_bits(pixels)
        if pixels.ndim == 3 and pixels.shape[2] == 4:
            found = "bgra8"
        gray = images.convert(pixels, found, "mono8")
    else:
        gray = images.decode_jpeg(payload, "mono8")
    dim = np.asarray(gray * np.float32(DIM), np.uint8)
    clock = datetime.fromtimestamp(since_ns / 1e9, UTC).strftime("%H:%M:%S UTC")
    words = f"no picture since {clock}"
    (wide, _), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 1.0, 2)
    scale = min(1.5, 0.9 * width / wide)
    place = (round(0.05 * width), height // 2)
    cv2.putText(dim, words, place, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, 1 + round(scale))
    return images.encode_png(dim) if png else images.encode_jpeg(dim, "mono8", 80)


def fitted(pixels: Pixels, size: tuple[int, int], *, invert: bool) -> Pixels:
    """Return pixels at a size, width and height, and turned by 180 degrees if so wanted."""
    height, width = pixels.shape[:2]
    if (width, height) != size:
        smaller = size[0] * size[1] < width * height
        how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        pixels = cast("Pixels", cv2.resize(pixels, size, interpolation=how))
    return cast("Pixels", np.ascontiguousarray(pixels[::-1, ::-1])) if invert else pixels
