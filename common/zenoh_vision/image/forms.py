"""The forms in which a picture travels, one class for each, in a registry by Zenoh encoding.

A form checks a payload before anything is decoded, opens it as a ``Picture``, and makes the payload
of a picture. To add a form, register an object of a class derived from ``PictureForm``: services,
viewer, snapshots and tools find it by the Zenoh encoding of the samples.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.limits import MAX_PIXEL_BYTES
from zenoh_vision.image.picture import JpegPicture, Picture, PixelPicture, PngPicture
from zenoh_vision.image.pixel_formats import ENCODINGS
from zenoh_vision.keys import BITS, JPEG, PNG, RAW_IMAGE
from zenoh_vision.messages import Header

Payload = bytes | memoryview


class PictureForm(ABC):
    """How pictures are written as bytes.

    Attributes:
        name: One word for people and for file names.
        encoding: Zenoh encoding of its payloads.
        signature: The first bytes of every payload; empty if they have no fixed ones.
        needs_header: Whether a payload does not state its own size.
        stands_alone: Whether a payload can be decoded without those before it. Only such payloads
            answer queries.
    """

    name: str
    encoding: str
    signature: bytes = b""
    needs_header: bool = True
    stands_alone: bool = True

    def most_bytes(self, max_pixels: int) -> int:
        """Return the largest payload of a picture with up to ``max_pixels`` pixels, bytes."""
        return max_pixels * MAX_PIXEL_BYTES

    def size(self, payload: Payload) -> tuple[int, int] | None:
        """Return width and height that the payload states; None if only its header does.

        Raises:
            PayloadError: It is no picture of this form.
        """
        del payload
        return None

    def pixel_encoding(self, payload: Payload) -> str:
        """Return the encoding of the pixels of a payload that came without a header."""
        del payload
        return "bgr8"

    def check(self, payload: Payload, header: Header) -> None:
        """Check a payload against its header, except the size that it states.

        Takes microseconds, since nothing is decoded.

        Raises:
            PayloadError: ``unsupported_encoding wrong_size too_large``.
        """
        del payload
        ENCODINGS[header.encoding or ""]  # or it is refused

    @abstractmethod
    def open(self, payload: Payload, header: Header, size: tuple[int, int] | None) -> Picture:
        """Return a payload that was checked as a picture; nothing need be decoded.

        ``size`` is what the method ``size`` returned, if it was asked.

        Raises:
            PayloadError: ``corrupt``.
        """

    @abstractmethod
    def make(self, picture: Picture, quality: int) -> bytes:
        """Return the payload of a picture.

        Args:
            picture: Of any form.
            quality: 1 to 100, for forms that have one.

        Raises:
            PayloadError: ``corrupt``: it must be decoded and cannot be.
        """

    def header(self, header: Header) -> Header:
        """Return the header that goes with a payload that is made of a frame's picture."""
        return header


class _FileForm(PictureForm):
    needs_header = False

    def most_bytes(self, max_pixels: int) -> int:
        """Return the largest file that is decoded, whatever its pixels."""
        del max_pixels
        return codecs.MAX_COMPRESSED_BYTES

    def size(self, payload: Payload) -> tuple[int, int]:
        """Return width and height by the file's own header."""
        return codecs.picture_size(bytes(payload))

    def header(self, header: Header) -> Header:
        """Return the header with ``16UC1`` instead of ``32FC1``: a file stores no metres."""
        if header.encoding != "32FC1":
            return header
        return header.model_copy(update={"encoding": "16UC1"})


class JpegForm(_FileForm):
    """JPEG."""

    name, encoding, signature = "jpeg", JPEG, codecs.JPEG_START

    def open(self, payload: Payload, header: Header, size: tuple[int, int] | None) -> Picture:
        """Return a JPEG as a picture."""
        return JpegPicture(bytes(payload), header.encoding or "bgr8", size)

    def make(self, picture: Picture, quality: int) -> bytes:
        """Return a picture as JPEG."""
        return picture.jpeg(quality)


class PngForm(_FileForm):
    """PNG, also of 16 bits and of one bit."""

    name, encoding, signature = "png", PNG, codecs.PNG_START

    def pixel_encoding(self, payload: Payload) -> str:
        """Return ``mono16`` for 16 bits of grey, else ``bgr8``."""
        return codecs.stored_encoding(bytes(payload[: codecs.PNG_HEAD]))

    def open(self, payload: Payload, header: Header, size: tuple[int, int] | None) -> Picture:
        """Return a PNG as a picture."""
        return PngPicture(bytes(payload), header.encoding or "bgr8", size)

    def make(self, picture: Picture, quality: int) -> bytes:
        """Return a picture as PNG."""
        del quality
        return picture.png()


class RawForm(PictureForm):
    """Pixel rows without padding, in the encoding that the header names."""

    name, encoding = "raw", RAW_IMAGE

    def check(self, payload: Payload, header: Header) -> None:
        """Check the number of bytes."""
        expected = pixel_formats.raw_size(header.encoding, header.width, header.height)
        if len(payload) != expected:
            size = f"{header.width}x{header.height} {header.encoding}"
            raise PayloadError("wrong_size", f"{len(payload)} bytes, {size} has {expected}")

    def open(self, payload: Payload, header: Header, size: tuple[int, int] | None) -> Picture:
        """Return raw pixels as a picture; a view of the payload."""
        del size
        known = ENCODINGS[header.encoding or ""]
        shape = (header.height, header.width, known.channels)
        try:
            pixels = np.frombuffer(payload, known.dtype).reshape(
                shape if known.channels > 1 else shape[:2]
            )
        except ValueError:
            RawForm.check(self, payload, header)
            raise
        return PixelPicture(pixels, header.encoding)

    def make(self, picture: Picture, quality: int) -> bytes:
        """Return the pixel rows of a picture."""
        del quality
        return pixel_formats.to_raw(picture.pixels, picture.encoding)


class BitsForm(PictureForm):
    """One bit a pixel of a picture of 0 and 255, for programs that have no decoder of PNG.

    The leftmost pixel is the highest bit of a byte; each row begins with a new byte, whose spare
    bits are 0.
    """

    name, encoding = "bits", BITS

    def check(self, payload: Payload, header: Header) -> None:
        """Check the number of bytes."""
        expected = (header.width + 7) // 8 * header.height
        if len(payload) != expected:
            raise PayloadError("wrong_size", f"{len(payload)} bytes of bits instead of {expected}")

    def open(self, payload: Payload, header: Header, size: tuple[int, int] | None) -> Picture:
        """Return packed bits as a picture of 0 and 255."""
        del size
        self.check(payload, header)
        return PixelPicture(unpack_bits(payload, header.width, header.height), bilevel=True)

    def make(self, picture: Picture, quality: int) -> bytes:
        """Return a picture as packed bits: 1 where it is not 0."""
        del quality
        return pack_bits(picture.in_8_bits("mono8"))


def pack_bits(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture, (height, width) uint8, as one bit a pixel: 1 where it is not 0."""
    return np.packbits(picture != 0, axis=1).tobytes()


def unpack_bits(bits: Payload, width: int, height: int) -> NDArray[np.uint8]:
    """Return packed bits as (height, width) uint8, 0 or 255."""
    rows = np.frombuffer(bits, np.uint8).reshape(height, -1)
    return np.unpackbits(rows, axis=1, count=width) * np.uint8(255)


FORMS: Final[dict[str, PictureForm]] = {}
"""The forms by Zenoh encoding."""


def register(form: PictureForm) -> PictureForm:
    """Add a form to the registry; return it."""
    FORMS[form.encoding] = form
    return form


JPEG_FORM: Final = register(JpegForm())
PNG_FORM: Final = register(PngForm())
RAW_FORM: Final = register(RawForm())
BITS_FORM: Final = register(BitsForm())


def form_named(name: str) -> PictureForm:
    """Return the form of a name.

    Raises:
        ValueError: There is none; the text lists those that there are.
    """
    for form in FORMS.values():
        if form.name == name:
            return form
    names = ", ".join(form.name for form in FORMS.values())
    raise ValueError(f"no form of pictures is called {name!r}; known are {names}")


def form_of(encoding: str, payload: Payload, default: str = JPEG) -> PictureForm:
    """Return the form of a payload.

    Args:
        encoding: Zenoh encoding of its sample, which foreign programs leave out or get wrong.
        payload: The first bytes decide among forms that have a signature.
        default: Zenoh encoding of pictures on its key.
    """
    form = FORMS.get(encoding) or FORMS.get(default, JPEG_FORM)
    if form.signature and payload[: len(form.signature)] != form.signature:
        for other in FORMS.values():
            if other.signature and payload[: len(other.signature)] == other.signature:
                return other
    return form


def opened(
    form: PictureForm,
    payload: Payload,
    header: Header,
    size: tuple[int, int] | None = None,
    key: str = "",
) -> Frame:
    """Return the frame of a payload that was checked; nothing is decoded yet.

    ``size`` is what ``form.size`` returned of it, if it was asked.

    Raises:
        PayloadError: ``corrupt``.
    """
    picture = form.open(payload, header, size)
    if picture.encoding != header.encoding:  # packed bits become grey, whatever the header says
        header = header.model_copy(update={"encoding": picture.encoding})
    return Frame(header, picture, key=key)
