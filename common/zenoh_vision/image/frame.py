"""``Frame``: a picture with the identity of the frame that it shows.

A frame's coordinates are those of its header: full-resolution pixels. A picture that was reduced
for a slow link is enlarged to that size when its pixels are asked for, so whoever counts in pixels
need not know of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.depth import RangeFinder, ValueRange
from zenoh_vision.image.picture import Picture, PixelPicture, lasting, picture_of, read_only
from zenoh_vision.image.pixel_formats import Pixels, to_raw
from zenoh_vision.messages import Header

View = Literal["pixels", "bgr", "gray"]
"""Names of the arrays that a frame makes of its picture."""

MAX_REDUCTION = 8
"""Most divisor of a picture's sides: a few bytes must not become the memory of a huge frame."""


class Frame:
    """One captured frame; safe to read from several threads.

    Args:
        header: Its identity and its size; ``header.encoding`` is the format of ``pixels``.
        picture: What it shows, in that encoding: a ``Picture``, the bytes of a JPEG or PNG, or
            pixels (height, width[, channels]), which are copied if they can be written to.
        quality: JPEG quality, 1 to 100, if it must be encoded.
        key: The key on which it arrived; empty if it was made in this process.

    Attributes:
        revision: The revision of the node's parameters that is active for this frame, a
            ``zenoh_vision.Revision``; None without parameters.
        captured: Whether a node has counted it as captured, and not yet as published or dropped.
        value_range: The 16-bit values that become 1 and 255 in 8 bits; None for all of them.
        is_deep: Whether it has more than 8 bits, depth or grey.
        is_reduced: Whether its picture is smaller than the frame.

    Raises:
        PayloadError: The picture is none, or not in the header's encoding; or its size is neither
            that of the frame nor that of a smaller picture of the same shape.
    """

    def __init__(
        self,
        header: Header,
        picture: Picture | Pixels | bytes,
        *,
        quality: int = 80,
        key: str = "",
        revision: Any = None,
        captured: bool = False,
    ) -> None:
        if isinstance(picture, bytes):
            picture = picture_of(picture, header.encoding or None)
        elif not isinstance(picture, Picture):
            picture = PixelPicture(lasting(picture), header.encoding or None)
        if header.encoding not in (None, picture.encoding):
            raise PayloadError(
                "unsupported_encoding", f"{picture.encoding} is no {header.encoding}"
            )
        self.header = header
        self.picture = picture
        self.quality = quality
        self.key = key
        self.revision = revision
        self.captured = captured
        self.value_range: ValueRange | None = None
        self.is_deep = picture.is_deep
        self.is_reduced = picture.size != (header.width, header.height)
        if self.is_reduced:
            check_shows(picture.size, header)
        self._full: dict[tuple[str, ValueRange | None], Pixels] = {}

    @property
    def compressed(self) -> bytes:
        """The picture as JPEG; as PNG if it has more than 8 bits or is bilevel."""
        return self.picture.compressed(self.quality)

    @property
    def pixels(self) -> Pixels:
        """(height, width[, channels]) in ``header.encoding``; read-only.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        return self._at_full_size("pixels", None, self.picture.pixels)

    @property
    def depth(self) -> NDArray[np.uint16] | None:
        """The 16-bit values, (height, width) uint16; read-only. None if the picture has 8 bits.

        They are millimetres for ``16UC1`` and ``32FC1``, and 0 is no reading.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        depth = self.picture.depth
        if depth is None:
            return None
        return self._at_full_size("depth", None, depth)  # type: ignore[return-value]

    @property
    def bgr(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 in BGR order, whatever the encoding; read-only."""
        return np.asarray(self.view("bgr"), np.uint8)

    @property
    def gray(self) -> NDArray[np.uint8]:
        """(height, width) uint8; from a JPEG the luma plane, without decoding colour."""
        return np.asarray(self.view("gray"), np.uint8)

    def view(self, name: View) -> Pixels:
        """Return ``pixels``, ``bgr`` or ``gray`` by its name."""
        if name == "pixels":
            return self.pixels
        encoding, values = "bgr8" if name == "bgr" else "mono8", self.value_range
        found = self.picture.in_8_bits(encoding, values)
        return self._at_full_size(encoding, values, found) if self.is_reduced else found

    def reduced(self, encoding: str, width: int, height: int) -> NDArray[np.uint8]:
        """Return the pixels in an 8-bit encoding, at least as large as the given size.

        A JPEG that was not decoded yet is decoded at a reduced scale, and not kept.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        found: Any = self.picture.reduced(encoding, width, height, self.value_range)
        if found.shape[0] < height or found.shape[1] < width:
            found = cv2.resize(found, (width, height), interpolation=cv2.INTER_LINEAR)
        return found  # type: ignore[no-any-return]

    @property
    def raw(self) -> bytes:
        """Pixel rows in ``header.encoding`` without padding."""
        return to_raw(self.pixels, self.picture.encoding)

    def write(self, target: NDArray[np.uint8]) -> None:
        """Write the pixel rows in ``header.encoding`` to memory.

        Args:
            target: (n,) uint8, writable, of as many bytes as the frame has.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        if self.is_reduced:
            target[:] = np.ascontiguousarray(self.pixels).view(np.uint8).reshape(-1)
        else:
            self.picture.write(target)

    def find_range(self, finder: RangeFinder) -> None:
        """Find the range of 16-bit values that becomes 8 bits, as the next of a stream.

        Raises:
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        depth = self.picture.depth
        if depth is not None and self.value_range is None:
            self.value_range = finder.range_of(depth)

    def _at_full_size(self, name: str, values: ValueRange | None, pixels: Pixels) -> Pixels:
        if not self.is_reduced:
            return pixels
        if (name, values) not in self._full:
            # Values of depth are picked: between two of them there may be no surface.
            how = cv2.INTER_NEAREST if self.is_deep else cv2.INTER_LINEAR
            size = self.header.width, self.header.height
            large: Any = cv2.resize(pixels, size, interpolation=how)
            self._full[name, values] = read_only(large)
        return self._full[name, values]


def check_shows(size: tuple[int, int], header: Header) -> None:
    """Check that a picture can show a frame: in its size, or reduced in both directions alike.

    Args:
        size: Width and height of the picture, pixels.
        header: That of the frame.

    Raises:
        PayloadError: ``wrong_size``.
    """
    width, height = size
    if size == (header.width, header.height):
        return
    # Rounding may shift either side by half a pixel.
    alike = 2 * abs(width * header.height - height * header.width) <= header.width + header.height
    smaller = width < header.width <= MAX_REDUCTION * width and (
        height < header.height or header.height == 1
    )
    if not (alike and smaller):
        raise PayloadError(
            "wrong_size", f"picture {width}x{height}, header {header.width}x{header.height}"
        )


Want = View | Callable[[Frame], object]
"""The view of a frame that a consumer needs, or a function that decodes it."""
