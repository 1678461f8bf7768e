"""``Frame``: what travels. A header and one picture, in whatever form it arrived.

It makes the other forms on demand and each at most once, so "encode only when someone listens",
"pass a JPEG through untouched" and "decode only grey" are what happens when nobody asks for the
costly form.
"""

from __future__ import annotations

import threading
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common import images, keys
from common.images import Pixels
from common.messages import Header

Form = Literal["pixels", "bgr", "gray"]


class Frame:
    """One captured frame; safe to read from several threads.

    Args:
        header: Its identity; ``header.encoding`` is what ``pixels`` are.
        pixels: (height, width[, channels]) in that encoding, if it was born so.
        compressed: JPEG, or PNG for 16 bits, if it was born or received so.
        quality: JPEG quality, 1 to 100, should it be encoded here.
    """

    def __init__(
        self,
        header: Header,
        *,
        pixels: Pixels | None = None,
        compressed: bytes | None = None,
        quality: int = 80,
    ) -> None:
        if (pixels is None) == (compressed is None):
            raise ValueError("a frame is born either as pixels or compressed")
        images.encoding_named(header.encoding)
        self.header = header
        self._encoding = header.encoding or ""
        self._pixels = pixels
        self._compressed = compressed
        self._quality = quality
        self._gray: NDArray[np.uint8] | None = None
        self._bgr: NDArray[np.uint8] | None = None
        self._lock = threading.RLock()

    @property
    def mime(self) -> str:
        """Zenoh encoding of ``compressed``."""
        if self._compressed is not None:
            return keys.PNG if self._compressed.startswith(images.PNG_START) else keys.JPEG
        return keys.PNG if self._encoding == "mono16" else keys.JPEG

    @property
    def compressed(self) -> bytes:
        """The picture as JPEG; as PNG for ``mono16``."""
        with self._lock:
            if self._compressed is None:
                assert self._pixels is not None
                if self._encoding == "mono16":
                    self._compressed = images.encode_png(self._pixels)
                else:
                    self._compressed = images.encode_jpeg(
                        self._pixels, self._encoding, self._quality
                    )
            return self._compressed

    @property
    def pixels(self) -> Pixels:
        """(height, width[, channels]) in ``header.encoding``; not to be written to.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            if self._pixels is None:
                self._pixels = self._decode(self._encoding)
            return self._pixels

    @property
    def bgr(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 in BGR order, whatever the encoding; not to be written to."""
        if self._encoding == "bgr8":
            return np.asarray(self.pixels, np.uint8)
        with self._lock:
            if self._bgr is None:
                self._bgr = self._eight_bits("bgr8")
            return self._bgr

    @property
    def gray(self) -> NDArray[np.uint8]:
        """(height, width) uint8; from a JPEG the luma plane, without decoding colour."""
        if self._encoding == "mono8":
            return np.asarray(self.pixels, np.uint8)
        with self._lock:
            if self._gray is None:
                self._gray = self._eight_bits("mono8")
            return self._gray

    def reduced(self, encoding: str, width: int, height: int) -> Pixels:
        """Return the pixels in an 8-bit encoding, no smaller than a size but perhaps larger.

        A JPEG that was not decoded yet is decoded at a reduced scale, and not kept.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        with self._lock:
            jpeg = self._compressed
            if self._pixels is None and jpeg is not None and jpeg.startswith(images.JPEG_START):
                return images.decode_jpeg(jpeg, encoding, (width, height))
            return self._eight_bits(encoding)

    @property
    def raw(self) -> bytes:
        """Pixel rows in ``header.encoding`` without padding."""
        return images.to_raw(self.pixels, self._encoding)

    def form(self, name: Form) -> Pixels:
        """Return ``pixels``, ``bgr`` or ``gray`` by its name."""
        if name == "bgr":
            return self.bgr
        return self.gray if name == "gray" else self.pixels

    def _eight_bits(self, encoding: str) -> NDArray[np.uint8]:
        if self._pixels is None and self._compressed is not None:
            return np.asarray(self._decode(encoding), np.uint8)
        return np.asarray(images.convert(self.pixels, self._encoding, encoding), np.uint8)

    def _decode(self, encoding: str) -> Pixels:
        assert self._compressed is not None
        if self._compressed.startswith(images.PNG_START):
            pixels = images.decode_png(self._compressed)
            if pixels.ndim == 3:
                pixels = pixels if pixels.dtype == np.uint8 else images.eight_bits(pixels)
                found = "bgr8" if pixels.shape[2] == 3 else "bgra8"
            else:
                found = "mono16" if pixels.dtype == np.uint16 else "mono8"
            return images.convert(pixels, found, encoding)
        if encoding == "mono16":
            return images.convert(images.decode_jpeg(self._compressed, "mono8"), "mono8", encoding)
        return images.decode_jpeg(self._compressed, encoding)
