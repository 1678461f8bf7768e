"""A picture in the form that a file's name asks for: as it came wherever that will do."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from common.errors import ConfigurationError, ExpectationNotMet, PayloadError
from common.keys import JPEG, PNG, RAW_IMAGE
from services.tools.snapshot.options import STDOUT
from services.tools.snapshot.shot import PNG_START, Shot

if TYPE_CHECKING:  # OpenCV takes a fifth of a second, and most snapshots are saved as they came
    from common.frame import Frame
    from common.images import Pixels

PNG_DEPTH = 24
"""Where a PNG's header says how many bits a channel has."""


def wanted_form(shot: Shot, output: str) -> str:
    """Return ``image/jpeg`` or ``image/png``: what the output's name says.

    Raises:
        ConfigurationError: It has 16 bits, which a JPEG cannot hold.
    """
    if output == STDOUT:
        return PNG if shot.mime == RAW_IMAGE else shot.mime
    form = PNG if PurePath(output).suffix.lower() == ".png" else JPEG
    if form == JPEG and has_16_bits(shot):
        raise ConfigurationError(
            f"{shot.key} has 16 bits a channel, which a JPEG cannot hold: "
            f"-o {PurePath(output).with_suffix('.png')}"
        )
    return form


def has_16_bits(shot: Shot) -> bool:
    """Tell whether its channels have 16 bits."""
    if shot.mime == PNG:
        return shot.payload[PNG_DEPTH : PNG_DEPTH + 1] == b"\x10"
    return shot.header is not None and shot.header.encoding == "mono16"


def encoded(shot: Shot, output: str, quality: int) -> bytes:
    """Return the picture as a JPEG or PNG file.

    Args:
        shot: The picture.
        output: Name of the file, or ``-``.
        quality: Of a JPEG, should it be encoded here.

    Raises:
        ConfigurationError: It cannot be had in that form.
        ExpectationNotMet: It cannot be decoded.
    """
    form = wanted_form(shot, output)
    if shot.mime == form:
        return shot.payload
    from common import images

    try:
        frame = frame_of(shot)
        if form == JPEG:
            return images.encode_jpeg(frame.pixels, frame.header.encoding or "", quality)
        pixels = frame.pixels
        if frame.header.encoding in ("rgb8", "rgba8"):  # a PNG is written from BGR
            pixels = images.convert(
                pixels, frame.header.encoding, frame.header.encoding.replace("rgb", "bgr")
            )
        return images.encode_png(pixels)
    except PayloadError as error:
        raise ExpectationNotMet(f"{shot.key}: {error}") from None


def frame_of(shot: Shot) -> Frame:
    """Return the picture as a frame, which decodes itself.

    Raises:
        PayloadError: Raw pixels without a header, or of another size than it says.
    """
    from common import images
    from common.frame import Frame
    from common.messages import Header

    header = shot.header
    if shot.mime == RAW_IMAGE:
        if header is None:
            raise PayloadError("no_header", "raw pixels say nothing without a header")
        pixels = images.from_raw(shot.payload, header.encoding or "", header.width, header.height)
        return Frame(header, pixels=pixels)
    width, height = images.picture_size(shot.payload)
    if header is None:
        header = Header(camera="unknown", epoch=0, seq=0, stamp_ns=0, width=width, height=height)
    if header.encoding is None:
        header = header.model_copy(update={"encoding": _own_encoding(shot)})
    return Frame(header, compressed=shot.payload)


def _own_encoding(shot: Shot) -> str:
    """Return what a picture's pixels are by the picture's own header."""
    if shot.payload.startswith(PNG_START):
        deep, kind = shot.payload[PNG_DEPTH] == 16, shot.payload[PNG_DEPTH + 1]
        if kind == 0:
            return "mono16" if deep else "mono8"
        return "bgra8" if kind in (4, 6) else "bgr8"
    import simplejpeg

    *_, space, _ = simplejpeg.decode_jpeg_header(shot.payload)
    return "mono8" if space == "Gray" else "bgr8"


def encoded_pixels(pixels: Pixels, output: str, quality: int, form: str) -> bytes:
    """Return BGR pixels as a JPEG or PNG file."""
    from common import images

    is_png = form == PNG if output == STDOUT else output.lower().endswith(".png")
    return images.encode_png(pixels) if is_png else images.encode_jpeg(pixels, "bgr8", quality)
