"""``Picture``: one picture before it has an identity, in the form in which it was made.

A picture makes its other forms on demand, each at most once. So a JPEG can be passed through
unchanged or decoded only to grey, and pixels that nobody wants as JPEG are never encoded. There is
a class for each form in which a picture comes: pixels, JPEG, PNG, and what a source has (planar.py,
packed.py, the frames of a video).
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, limits, pixel_formats
from zenoh_vision.image.depth import ValueRange, eight_bits
from zenoh_vision.image.pixel_formats import DEEP, ENCODINGS, Pixels
from zenoh_vision.keys import JPEG, PNG

Box = tuple[int, int, int, int]
"""x, y, width and height, pixels."""

A = TypeVar("A", bound=NDArray[Any])


class Picture(ABC):
    """One picture; safe to use from several threads.

    Args:
        encoding: That of ``pixels``: ``bgr8``, ``mono8``, ...
        width: Pixels.
        height: Pixels.
        is_deep: Whether it has more than 8 bits, depth or grey; None to go by the encoding.

    Attributes:
        mime: Zenoh encoding of ``compressed``: its own form, else PNG for 16 bits, else JPEG.
    """

    form: str | None = None
    """Zenoh encoding of the bytes from which it was made; None if it was not made from a file."""

    bilevel: bool = False
    """Whether all pixels are 0 or 255, so that a PNG needs one bit each."""

    has_padding: bool = False
    """Whether the decoder skipped bytes of it that do not belong to a JPEG."""

    is_reduced: bool = False
    """Whether it is another picture in a smaller size, so that it shows all of the other."""

    def __init__(
        self, encoding: str, width: int, height: int, *, is_deep: bool | None = None
    ) -> None:
        self.encoding = encoding
        self.width = width
        self.height = height
        self.size = (width, height)
        self.is_deep = encoding in DEEP if is_deep is None else is_deep
        self.mime = self.form or (PNG if self.is_deep else JPEG)
        self._pixels: Pixels | None = None
        self._depth: NDArray[np.uint16] | None = None
        self._encoded: tuple[int, bytes] | None = None
        self._shown: dict[tuple[str, ValueRange | None], NDArray[np.uint8]] = {}
        self._lock = threading.RLock()

    @property
    def pixels(self) -> Pixels:
        """(height, width[, channels]) in ``encoding``; read-only.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._pixels is None:
                self._pixels = read_only(self._make_pixels())
            return self._pixels

    @property
    def depth(self) -> NDArray[np.uint16] | None:
        """The 16-bit values, (height, width) uint16; read-only. None if the picture has 8 bits.

        They are millimetres for ``16UC1`` and ``32FC1``, and 0 is no reading.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self.is_deep and self._depth is None:
                self._depth = read_only(self._make_depth())
            return self._depth

    def in_8_bits(self, encoding: str, values: ValueRange | None = None) -> NDArray[np.uint8]:
        """Return the pixels in an 8-bit encoding: (height, width[, channels]); read-only.

        Args:
            encoding: Its name.
            values: The 16-bit values that become 1 and 255, if it has 16 bits; None for all.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        if self.encoding == encoding and not self.is_deep:
            return np.asarray(self.pixels if self._pixels is None else self._pixels, np.uint8)
        with self._lock:
            if (encoding, values) not in self._shown:
                self._shown[encoding, values] = read_only(self._make_8_bits(encoding, values))
            return self._shown[encoding, values]

    def reduced(
        self, encoding: str, width: int, height: int, values: ValueRange | None = None
    ) -> NDArray[np.uint8]:
        """Return the pixels in an 8-bit encoding, as ``in_8_bits``; a smaller size may do.

        A JPEG that was not decoded yet is decoded at a reduced scale, and not kept.

        The size is the least that will do; the picture may be smaller itself.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        del width, height
        return self.in_8_bits(encoding, values)

    def write(self, target: NDArray[np.uint8]) -> None:
        """Write the pixel rows in ``encoding`` to memory.

        Args:
            target: (n,) uint8, writable, of as many bytes as the pixels have.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        pixels = self.pixels
        np.copyto(target.view(ENCODINGS[self.encoding].dtype).reshape(pixels.shape), pixels)

    def compressed(self, quality: int) -> bytes:
        """Return the picture as a file of the type ``mime``; its own bytes if it was made from one.

        Args:
            quality: Of a JPEG that must be encoded, 1 to 100.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._encoded is None or self._encoded[0] != quality:
                self._encoded = quality, self.png() if self.mime == PNG else self.jpeg(quality)
            return self._encoded[1]

    def jpeg(self, quality: int) -> bytes:
        """Return the picture as a JPEG; of 16 bits it has the upper 8.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        if self.is_deep or self.encoding in DEEP:
            return codecs.encode_jpeg(self.in_8_bits("mono8"), "mono8", quality)
        return codecs.encode_jpeg(self.pixels, self.encoding, quality)

    def png(self) -> bytes:
        """Return the picture as a PNG, in 16 bits if it has those.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        if self.is_deep:
            return codecs.encode_png(np.asarray(self.depth))
        stored = "mono8" if ENCODINGS[self.encoding].channels == 1 else self.encoding
        swapped = {"rgb8": "bgr8", "rgba8": "bgra8"}.get(stored, stored)
        return codecs.encode_png(self.in_8_bits(swapped))

    def cropped(self, box: Box) -> Picture:
        """Return the part in a rectangle, which must be within the picture.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        x, y, width, height = box
        # A copy, so that the rest is not kept in memory.
        return PixelPicture(self.pixels[y : y + height, x : x + width].copy(), self.encoding)

    def turned(self, flip: str, encoding: str, rotate: int = 0) -> Picture:
        """Return the picture rotated, then mirrored, in an encoding; itself if nothing changes.

        Args:
            flip: ``none``, ``horizontal``, ``vertical`` or ``both``.
            encoding: Its name.
            rotate: 0, 90, 180 or 270 degrees clockwise.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        if flip == "none" and not rotate and encoding == self.encoding:
            return self
        pixels = self.pixels
        if rotate:
            pixels = cv2.rotate(pixels, ROTATE_CODES[rotate])  # type: ignore[assignment]
        if flip != "none":
            pixels = cv2.flip(pixels, FLIP_CODES[flip])  # type: ignore[assignment]
        return PixelPicture(pixel_formats.convert(pixels, self.encoding, encoding), encoding)

    def scaled(self, width: int, height: int) -> Picture:
        """Return the picture in a smaller size; of 16 bits, values are picked, not averaged.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        if self.is_deep:
            pixels: Any = self.pixels
            how = cv2.INTER_NEAREST
        else:
            pixels, how = self.reduced(self.encoding, width, height), cv2.INTER_AREA
        if pixels.shape[:2] != (height, width):
            pixels = cv2.resize(pixels, (width, height), interpolation=how)
        found = PixelPicture(pixels, self.encoding)
        found.is_reduced = True
        return found

    def equals(self, other: Picture) -> bool:
        """Tell whether another picture of the same form has the same values; decodes nothing."""
        return type(self) is type(other) and self.size == other.size and self._equals(other)

    @abstractmethod
    def _make_pixels(self) -> Pixels:
        """Return the pixels in ``encoding``."""

    @abstractmethod
    def _equals(self, other: Any) -> bool:
        """Tell whether another picture of this class has the same values."""

    def _make_depth(self) -> NDArray[np.uint16]:
        return pixel_formats.sixteen_bits(self.pixels, self.encoding)

    def _make_8_bits(self, encoding: str, values: ValueRange | None) -> NDArray[np.uint8]:
        if (depth := self.depth) is not None:
            gray = eight_bits(depth, values)
            return np.asarray(pixel_formats.convert(gray, "mono8", encoding), np.uint8)
        return np.asarray(pixel_formats.convert(self.pixels, self.encoding, encoding), np.uint8)


FLIP_CODES = {"horizontal": 1, "vertical": 0, "both": -1}
ROTATE_CODES = {
    90: cv2.ROTATE_90_CLOCKWISE,
    180: cv2.ROTATE_180,
    270: cv2.ROTATE_90_COUNTERCLOCKWISE,
}


class PixelPicture(Picture):
    """A picture as pixels.

    Args:
        pixels: (height, width[, channels]); kept, and must not change.
        encoding: By default that of the channels and dtype, colour as B, G, R.
        bilevel: All pixels are 0 or 255, so that a PNG needs one bit each.

    Raises:
        PayloadError: ``unsupported_encoding``: no such encoding, or the array has another shape or
            dtype.
    """

    def __init__(
        self, pixels: Pixels, encoding: str | None = None, *, bilevel: bool = False
    ) -> None:
        named = pixel_formats.encoding_of(pixels, encoding)
        super().__init__(named, pixels.shape[1], pixels.shape[0])
        if bilevel:
            self.bilevel, self.mime = True, PNG
        if pixels.flags.writeable:
            pixels = pixels.view()
            pixels.flags.writeable = False
        self._pixels = pixels

    def png(self) -> bytes:
        """Return the picture as a PNG."""
        return codecs.encode_png(self.pixels, bilevel=True) if self.bilevel else super().png()

    def _make_pixels(self) -> Pixels:
        raise AssertionError("a picture of pixels has them")

    def _equals(self, other: PixelPicture) -> bool:
        return are_equal(self.pixels, other.pixels)


class _FilePicture(Picture):
    """A picture as the bytes of a file.

    Args:
        data: The file.
        encoding: Of the pixels.
        size: Width and height, if they were read from the file already.
        strict: Whether a flaw that a decoder could repair is an error, so that a damaged picture is
            not taken for an intact one.
        is_deep: Whether it has more than 8 bits, depth or grey.

    Raises:
        PayloadError: It is no such file, or too large, or the encoding is unknown.
    """

    def __init__(
        self,
        data: bytes,
        encoding: str = "bgr8",
        size: tuple[int, int] | None = None,
        *,
        strict: bool = True,
        is_deep: bool = False,
    ) -> None:
        ENCODINGS[encoding]  # or it is refused
        width, height = size or codecs.picture_size(data)
        super().__init__(encoding, width, height, is_deep=is_deep)
        self.data = data
        self._strict = strict

    def compressed(self, _quality: int) -> bytes:
        """Return the file."""
        return self.data

    def _equals(self, other: _FilePicture) -> bool:
        return self.data == other.data


class JpegPicture(_FilePicture):
    """A picture as JPEG."""

    form = JPEG

    def jpeg(self, _quality: int) -> bytes:
        """Return the file, whose quality is its own."""
        return self.data

    def reduced(
        self, encoding: str, width: int, height: int, values: ValueRange | None = None
    ) -> NDArray[np.uint8]:
        """Return the pixels in an 8-bit encoding, decoded at a reduced scale if not yet decoded."""
        with self._lock:
            if self._pixels is None and (encoding, values) not in self._shown:
                return self._decode(encoding, (width, height))
        return super().reduced(encoding, width, height, values)

    def write(self, target: NDArray[np.uint8]) -> None:
        """Write the pixel rows to memory: decoded into it, if they were not decoded before."""
        with self._lock:
            if self._pixels is None and self.encoding not in DEEP:
                codecs.decode_jpeg(
                    self.data,
                    self.encoding,
                    strict=self._strict,
                    target=target,
                    skipped=self._note_padding,
                )
                return
        super().write(target)

    def turned(self, flip: str, encoding: str, rotate: int = 0) -> Picture:
        """Return the picture turned, in an encoding; grey is decoded from the luma alone.

        It stays the same file if only the order of the colours changes, or grey becomes colours.
        """
        is_turned = flip != "none" or rotate != 0
        if not is_turned and encoding == self.encoding:
            return self
        if not is_turned and encoding not in (*DEEP, "mono8"):
            return JpegPicture(self.data, encoding, self.size, strict=self._strict)
        decoded = "mono8" if encoding in ("mono8", "mono16") else "bgr8"
        return PixelPicture(self.in_8_bits(decoded), decoded).turned(flip, encoding, rotate)

    def _make_pixels(self) -> Pixels:
        if self.encoding not in DEEP:
            return self._decode(self.encoding)
        return pixel_formats.convert(self._decode("mono8"), "mono8", self.encoding)

    def _make_8_bits(self, encoding: str, values: ValueRange | None) -> NDArray[np.uint8]:
        if self._pixels is None:
            return self._decode(encoding)
        return super()._make_8_bits(encoding, values)

    def _decode(self, encoding: str, least: tuple[int, int] = (0, 0)) -> NDArray[np.uint8]:
        return codecs.decode_jpeg(
            self.data, encoding, least, strict=self._strict, skipped=self._note_padding
        )

    def _note_padding(self) -> None:
        self.has_padding = True


class PngPicture(_FilePicture):
    """A picture as PNG, which is always decoded strictly."""

    form = PNG

    def __init__(
        self, data: bytes, encoding: str = "bgr8", size: tuple[int, int] | None = None
    ) -> None:
        super().__init__(data, encoding, size, is_deep=codecs.is_deep_png(data))

    def png(self) -> bytes:
        """Return the file."""
        return self.data

    def _make_pixels(self) -> Pixels:
        depth = self.depth
        if depth is not None:
            if self.encoding in DEEP:
                return pixel_formats.convert(depth, "16UC1", self.encoding)
            return pixel_formats.convert(eight_bits(depth), "mono8", self.encoding)
        stored = codecs.decode_png(self.data)
        if stored.dtype == np.uint16:  # colour
            stored = eight_bits(stored)
        return pixel_formats.convert(stored, pixel_formats.encoding_of(stored), self.encoding)

    def _make_depth(self) -> NDArray[np.uint16]:
        stored = np.asarray(codecs.decode_png(self.data), np.uint16)
        return stored if stored.ndim == 2 else stored[:, :, 0]  # grey beside transparency


def lasting(pixels: Pixels) -> Pixels:
    """Return pixels that nobody can write to any more: a copy, unless all of their memory is so."""
    array: NDArray[Any] | None = pixels
    while isinstance(array, np.ndarray):
        if array.flags.writeable:
            return pixels.copy()
        array = array.base
    return pixels


def picture_of(data: bytes, encoding: str | None = None) -> Picture:
    """Return the bytes of a JPEG or PNG as a picture.

    Args:
        data: The file.
        encoding: Of the pixels; by default ``bgr8``, or ``mono16`` of a grey PNG with 16 bits.

    Raises:
        PayloadError: It is neither, too large, or the encoding is unknown.
    """
    size = codecs.picture_size(data)
    named = encoding or codecs.stored_encoding(data)
    if codecs.picture_type(data) == PNG:
        return PngPicture(data, named, size)
    return JpegPicture(data, named, size)


def check_size(width: int, height: int) -> None:
    """Check that a picture of this size may be published.

    Raises:
        PayloadError: ``too_large``.
    """
    most, longest = limits.MAX_PIXELS, limits.MAX_SIDE
    if not 0 < width * height <= most:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {most} in all")
    if max(width, height) > longest:
        raise PayloadError("too_large", f"{width}x{height} pixels, a side at most {longest}")


def read_only(pixels: A) -> A:
    """Return a view that cannot be written to: others may read the same pixels."""
    view = pixels.view()
    view.flags.writeable = False
    return view


def are_equal(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Tell whether two arrays are equal; one row is nearly always enough to find a difference."""
    if one.shape != other.shape:
        return False
    row = one.shape[0] // 2
    return np.array_equal(one[row], other[row]) and np.array_equal(one, other)
