"""Renders pictures for clients: resizes, rotates, and encodes as JPEG or PNG."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Literal, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image import codecs
from zenoh_vision.image.depth import RangeFinder, ValueRange, eight_bits
from zenoh_vision.image.exif import as_stored
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import picture_of
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import JPEG, PNG
from zenoh_vision.messages import Header

MAX_SIDE = 7680
MAX_PIXELS = 4096 * 2304
"""Limit of the size of enlarged pictures, since all clients share memory and CPU time."""

DIM = 0.35


Depth = Literal["original", "gray", "values"]
"""How a picture of 16 bits becomes a PNG. ``original``: of 16 bits. ``gray``: of 8 bits, which
browsers can show. ``values``: of 3 channels of 8 bits, from which a page, whose canvas has only 8
bits, reads the values: red is the high byte, green the low byte, blue the grey value."""


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """How pictures are rendered for a client; by default the bytes are not changed.

    With ``fit``, the picture is scaled down to fit into width and height, never enlarged; else it
    is stretched to them, and if one of them is None it is derived from the other.
    """

    width: int | None = None  # pixels
    height: int | None = None
    fit: bool = False
    quality: int | None = None  # of a JPEG; None for the viewer's setting
    invert: bool = False  # rotate by 180 degrees
    format: Literal["jpeg", "png"] | None = None  # None to keep the format
    depth: Depth = "original"

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the size to which a picture of this width and height is rendered, pixels."""
        if self.fit:
            scale = min(1.0, (self.width or width) / width, (self.height or height) / height)
            return max(1, round(width * scale)), max(1, round(height * scale))
        if (self.width is None) == (self.height is None):
            return self.width or width, self.height or height
        wide = self.width or width * (self.height or height) / height
        high = self.height or height * (self.width or width) / width
        scale = min(1.0, (MAX_PIXELS / (wide * high)) ** 0.5, MAX_SIDE / wide, MAX_SIDE / high)
        return max(1, round(wide * scale)), max(1, round(high * scale))

    def unchanged(self, mime: str, width: int, height: int) -> bool:
        """Tell whether an encoded picture of this type and size needs no change."""
        return (
            self.size(width, height) == (width, height)
            and not self.invert
            and not (self.quality is not None and mime == JPEG)
            and self.format in (None, mime.removeprefix("image/"))
        )


@dataclass(slots=True, eq=False)
class EncodedPicture:
    """A picture for clients: the header is the frame's, the size is that of this picture."""

    key: str
    header: Header
    payload: bytes
    mime: str
    width: int
    height: int
    number: int = 0  # number of frames that had arrived on the key, including this one
    missed: int = 0  # number of frames that never arrived, by sequence numbers
    ended_ns: int | None = None  # when the last picture arrived, if it shows that; ns since 1970
    values: ValueRange | None = None  # of 16 bits: the values that became 1 and 255
    packed: bool = False  # whether it holds the exact values of 16 bits
    rendered: bool = False  # whether these are other bytes than those that arrived
    _messages: dict[str, bytes] = field(default_factory=dict, repr=False)

    def age_ms(self, now_ns: int) -> float:
        """Return its age at ``now_ns``, ns since 1970, in milliseconds."""
        return (now_ns - self.header.age_start_ns) / 1e6

    def once(self, name: str, make: Callable[[EncodedPicture], bytes]) -> bytes:
        """Return the bytes that ``make`` makes of the picture, cached under a name."""
        if name not in self._messages:
            self._messages[name] = make(self)
        return self._messages[name]


def original(frame: Frame, options: RenderOptions) -> EncodedPicture | None:
    """Return a picture of a frame's unchanged bytes; None if it must be encoded or changed."""
    mime, size = frame.picture.form, frame.picture.size
    if mime is None or not options.unchanged(mime, *size):
        return None
    if frame.is_deep and options.depth != "original":
        return None
    payload = as_stored(frame.compressed) if mime == JPEG else frame.compressed
    return EncodedPicture(frame.key, frame.header, payload, mime, *size)


def cost(frame: Frame, options: RenderOptions) -> int:
    """Return how many pixels are rendered for each picture like this frame; 0 if unchanged."""
    if original(frame, options) is not None:
        return 0
    width, height = options.size(*frame.picture.size)
    return width * height


def render(
    frame: Frame, options: RenderOptions, quality: int, finder: RangeFinder | None = None
) -> EncodedPicture:
    """Return a frame's rendered picture.

    Args:
        frame: With a picture of its own size or a reduced one.
        options: Size, format and depth.
        quality: Of a JPEG, unless the options have one.
        finder: Finds the range by which 16 bits of the frame's stream become 8, unless the frame
            has one; None for all values.

    Raises:
        PayloadError: ``corrupt``: it cannot be decoded.
    """
    header, shape = frame.header, frame.picture.size
    size = options.size(*shape)
    as_png = options.format == "png" or (options.format is None and frame.picture.mime == PNG)
    if finder is not None:
        frame.find_range(finder)
    depth = frame.picture.depth
    packed = depth is not None and options.depth == "values"
    if depth is not None and options.depth == "gray" and options.quality is not None:
        as_png = False  # a JPEG was requested, which is smaller
    encoding = header.encoding or "bgr8"
    shown = "mono8" if encoding.startswith("mono") or depth is not None else "bgr8"
    pixels: Pixels
    if depth is not None and packed:
        found = np.asarray(_resized(depth, size, cv2.INTER_NEAREST), np.uint16)  # no mixed values
        pixels = _packed(found, frame.value_range)
        as_png = True
    elif depth is not None and as_png and options.depth == "original":
        pixels = _resized(depth, size)
    else:
        pixels = _resized(frame.reduced(shown, *size), size)
    if options.invert:
        pixels = cast("Pixels", np.ascontiguousarray(pixels[::-1, ::-1]))
    if as_png:
        payload = codecs.encode_png(pixels, bilevel=frame.picture.bilevel and size == shape)
    else:
        payload = codecs.encode_jpeg(pixels, shown, options.quality or quality)
    picture = EncodedPicture(frame.key, header, payload, PNG if as_png else JPEG, *size)
    picture.values, picture.packed, picture.rendered = frame.value_range, packed, True
    return picture


def _resized(pixels: Pixels, size: tuple[int, int], interpolation: int | None = None) -> Pixels:
    """Return pixels resized to a width and height; by default averaged when reduced."""
    if size == pixels.shape[1::-1]:
        return pixels
    if interpolation is None:
        smaller = size[0] * size[1] < pixels.shape[0] * pixels.shape[1]
        interpolation = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    return cast("Pixels", cv2.resize(pixels, size, interpolation=interpolation))


def _packed(depth: NDArray[np.uint16], values: ValueRange | None) -> NDArray[np.uint8]:
    """Return 16-bit values as (height, width, 3): grey, low byte, high byte, as BGR."""
    parts = (eight_bits(depth, values), depth & 0xFF, depth >> 8)
    return np.dstack([np.asarray(part, np.uint8) for part in parts])


def render_ended(picture: EncodedPicture, since_ns: int) -> EncodedPicture:
    """Return the last picture of a stream that has ended: dim, grey, with the time.

    ``since_ns`` is when it arrived, ns since 1970. The picture keeps its size and type.

    Raises:
        PayloadError: ``corrupt``: it cannot be decoded.
    """
    gray = picture_of(picture.payload).in_8_bits("mono8", picture.values)
    dim = np.asarray(gray * np.float32(DIM), np.uint8)
    clock = datetime.fromtimestamp(since_ns / 1e9, UTC).strftime("%H:%M:%S UTC")
    words = f"no picture since {clock}"
    (text_width, _), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 1.0, 2)
    scale = min(1.5, 0.9 * picture.width / text_width)
    place = (round(0.05 * picture.width), picture.height // 2)
    cv2.putText(dim, words, place, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, 1 + round(scale))
    as_png = picture.mime == PNG
    payload = codecs.encode_png(dim) if as_png else codecs.encode_jpeg(dim, "mono8", 80)
    return replace(picture, payload=payload, ended_ns=since_ns, _messages={})
