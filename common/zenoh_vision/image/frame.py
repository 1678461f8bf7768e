"""``Frame``: a header and one picture, in the form in which it was made or received.

A frame makes its other forms on demand, each at most once. So a JPEG can be passed through
unchanged or decoded only to grey, and pixels that nobody wants as JPEG are never encoded.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.depth import RangeFinder, ValueRange, eight_bits
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.image.stored import StoredPicture
from zenoh_vision.keys import JPEG, PNG
from zenoh_vision.messages import Header

Form = Literal["pixels", "bgr", "gray"]

A = TypeVar("A", bound=NDArray[Any])


class Frame:
    """One captured frame; safe to read from several threads.

    Args:
        header: Its identity; ``header.encoding`` is the format of ``pixels``.
        pixels: (height, width[, channels]) in that encoding, if it is made from pixels.
        compressed: JPEG, or PNG for 16 bits, if it is made from a compressed picture; bytes.
        stored: A source's picture that is not converted yet, if it is made from one; in colour, 8
            bits.
        finder: Finds the range of 16-bit values that becomes 8 bits; None for the whole range.
        quality: JPEG quality, 1 to 100, if it must be encoded.
        key: The key on which it arrived; empty if it was made in this process.
        borrowed: ``pixels`` is a view of memory that the transport owns.
        bilevel: All ``pixels`` are 0 or 255, and ``compressed`` is a PNG of one bit each.

    A borrowed frame is valid only until the next one is requested; ``keep`` returns one that
    lasts. Frames own their memory unless borrowed ones were requested.

    Attributes:
        revision: The revision of the node's parameters that is active for this frame, a
            ``zenoh_vision.Revision``; None without parameters.
    """

    def __init__(
        self,
        header: Header,
        *,
        pixels: Pixels | None = None,
        compressed: bytes | None = None,
        stored: StoredPicture | None = None,
        quality: int = 80,
        key: str = "",
        borrowed: bool = False,
        bilevel: bool = False,
        finder: RangeFinder | None = None,
    ) -> None:
        if [pixels is None, compressed is None, stored is None].count(False) != 1:
            raise ValueError("a frame is made from either pixels, a stored or a compressed picture")
        pixel_formats.encoding_named(header.encoding)
        self.header = header
        self.key = key
        self.borrowed = borrowed
        self.bilevel = bilevel
        self.revision: Any = None
        self._encoding = header.encoding or ""
        self._pixels = None if pixels is None else _read_only(pixels)
        self._compressed = compressed
        self._stored = stored
        self._quality = quality
        self._is_deep = (
            self._encoding in pixel_formats.DEEP
            if compressed is None
            else codecs.is_deep_png(compressed)
        )
        self._finder = finder
        self._depth: NDArray[np.uint16] | None = None
        self._value_range: ValueRange | None = None
        self._forms: dict[str, NDArray[np.uint8]] = {}
        self._lock = threading.RLock()

    def keep(self) -> Frame:
        """Return a frame that owns its memory: itself, or a copy of a borrowed one."""
        if not self.borrowed:
            return self
        kept = Frame(self.header, pixels=self.pixels.copy(), quality=self._quality, key=self.key)
        kept.revision = self.revision
        kept._finder, kept._value_range = self._finder, self.value_range
        return kept

    @property
    def mime(self) -> str:
        """Zenoh encoding of ``compressed``."""
        if self._compressed is not None:
            return codecs.picture_type(self._compressed) or JPEG
        return PNG if self._is_deep or self.bilevel else JPEG

    @property
    def is_compressed(self) -> bool:
        """Whether ``compressed`` exists already, so that nothing has to be encoded."""
        return self._compressed is not None

    @property
    def compressed(self) -> bytes:
        """The picture as JPEG; as PNG if it has more than 8 bits or is bilevel."""
        with self._lock:
            if self._compressed is None:
                self._compressed = self._encode()
            return self._compressed

    @property
    def compressed_header(self) -> Header:
        """The header that belongs to ``compressed``: with ``16UC1`` instead of ``32FC1``."""
        if self._encoding != "32FC1":
            return self.header
        return self.header.model_copy(update={"encoding": "16UC1"})

    @property
    def depth(self) -> NDArray[np.uint16] | None:
        """The 16-bit values, (height, width) uint16; read-only. None if the picture has 8 bits.

        They are millimetres for ``16UC1`` and ``32FC1``, and 0 is no reading.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._depth is None and self._is_deep:
                if self._pixels is not None and self._encoding in pixel_formats.DEEP:
                    self._depth = pixel_formats.sixteen_bits(self._pixels, self._encoding)
                elif self._compressed is not None:
                    decoded = codecs.decode_deep_png(self._compressed)
                    self._depth = None if decoded is None else _read_only(decoded)
                    self._is_deep = decoded is not None
            return self._depth

    @property
    def is_deep(self) -> bool:
        """Whether it has more than 8 bits, depth or grey: by its encoding or the PNG's header."""
        return self._is_deep

    @property
    def value_range(self) -> ValueRange | None:
        """The 16-bit values that become 1 and 255; None if it has 8 bits, or for the whole range.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._value_range is None and self._finder is not None:
                depth = self.depth
                self._value_range = None if depth is None else self._finder.range_of(depth)
            return self._value_range

    @property
    def pixels(self) -> Pixels:
        """(height, width[, channels]) in ``header.encoding``; read-only.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._pixels is None and self._stored is not None:
                bgr = self._stored.bgr()
                self._pixels = _read_only(pixel_formats.convert(bgr, "bgr8", self._encoding))
            elif self._pixels is None:
                self._pixels = _read_only(self._decode(self._encoding))
            return self._pixels

    @property
    def bgr(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 in BGR order, whatever the encoding; read-only."""
        return self._kept_form("bgr8")

    @property
    def gray(self) -> NDArray[np.uint8]:
        """(height, width) uint8; from a JPEG the luma plane, without decoding colour."""
        return self._kept_form("mono8")

    def reduced(self, encoding: str, width: int, height: int) -> Pixels:
        """Return the pixels in an 8-bit encoding, at least as large as the given size.

        A JPEG that was not decoded yet is decoded at a reduced scale, and not kept.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            jpeg = None if self._stored is not None else self._compressed
            if self._pixels is None and jpeg is not None and jpeg.startswith(codecs.JPEG_START):
                return codecs.decode_jpeg(jpeg, encoding, (width, height))
            return self._eight_bits(encoding)

    @property
    def raw(self) -> bytes:
        """Pixel rows in ``header.encoding`` without padding."""
        return pixel_formats.to_raw(self.pixels, self._encoding)

    def copy_raw(self, target: NDArray[np.uint8]) -> None:
        """Write the pixel rows in ``header.encoding`` to memory of their size.

        A JPEG or a stored picture of which no pixels were made yet is decoded into it; the pixels
        are kept only if that is not possible.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._pixels is None and self._stored is not None and self._encoding == "bgr8":
                width, height = self._stored.size
                self._stored.copy_bgr(target.reshape(height, width, 3))
                return
            jpeg = None if self._stored is not None else self._compressed
            shallow = self._encoding not in pixel_formats.DEEP
            if self._pixels is None and jpeg is not None and shallow:
                size = (self.header.width, self.header.height)
                if jpeg.startswith(codecs.JPEG_START) and codecs.picture_size(jpeg) == size:
                    codecs.decode_jpeg(jpeg, self._encoding, target=target)
                    return
            pixels = self.pixels
        known = pixel_formats.ENCODINGS[self._encoding]
        np.copyto(target.view(known.dtype).reshape(pixels.shape), pixels)

    def form(self, name: Form) -> Pixels:
        """Return ``pixels``, ``bgr`` or ``gray`` by its name."""
        if name == "bgr":
            return self.bgr
        return self.gray if name == "gray" else self.pixels

    def _encode(self) -> bytes:
        if self._stored is not None:
            return self._stored.jpeg(self._quality)
        assert self._pixels is not None
        depth = self.depth
        if depth is not None:
            return codecs.encode_png(depth)
        if self.bilevel:
            return codecs.encode_png(self._pixels, bilevel=True)
        return codecs.encode_jpeg(self._pixels, self._encoding, self._quality)

    def _kept_form(self, encoding: str) -> NDArray[np.uint8]:
        if self._encoding == encoding:
            return np.asarray(self.pixels, np.uint8)
        with self._lock:
            if encoding not in self._forms:
                self._forms[encoding] = _read_only(self._eight_bits(encoding))
            return self._forms[encoding]

    def _eight_bits(self, encoding: str) -> NDArray[np.uint8]:
        depth = self.depth
        if depth is not None:
            gray = eight_bits(depth, self.value_range)
            return np.asarray(pixel_formats.convert(gray, "mono8", encoding), np.uint8)
        if self._pixels is None and self._stored is None and self._compressed is not None:
            return np.asarray(self._decode(encoding), np.uint8)
        return np.asarray(pixel_formats.convert(self.pixels, self._encoding, encoding), np.uint8)

    def _decode(self, encoding: str) -> Pixels:
        assert self._compressed is not None
        if not self._compressed.startswith(codecs.PNG_START):
            shallow = "mono8" if encoding in pixel_formats.DEEP else encoding
            pixels: Pixels = codecs.decode_jpeg(self._compressed, shallow)
            return pixel_formats.convert(pixels, shallow, encoding)
        depth = self.depth
        if depth is not None:
            if encoding not in pixel_formats.DEEP:
                return self._eight_bits(encoding)
            return pixel_formats.convert(depth, "16UC1", encoding)
        pixels = codecs.decode_png(self._compressed)
        if pixels.dtype == np.uint16:  # colour
            pixels = eight_bits(pixels)
        return pixel_formats.convert(pixels, pixel_formats.encoding_of(pixels), encoding)


def _read_only(pixels: A) -> A:
    """Return a view that cannot be written to: others may read the same pixels."""
    view = pixels.view()
    view.flags.writeable = False
    return view


Want = Form | Callable[[Frame], object]
"""The form of a frame that a consumer needs, or a function that decodes it."""
