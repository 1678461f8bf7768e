"""Converts a source's picture to a frame to publish: flips, encodes or passes it on."""

from __future__ import annotations

import cv2

from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.messages import Header, Track
from zv.camera.sources.base import Picture

FLIP_CODES = {"horizontal": 1, "vertical": 0, "both": -1}


def check_depth(delivered: str, wanted: str) -> None:
    """Check that pictures of one encoding can be published in another.

    Any picture can be converted, except that grey levels and colours are no distances.

    Raises:
        ParameterRefused: Depth is requested of pictures without depth.
    """
    if wanted in pixel_formats.DISTANCES and delivered not in pixel_formats.DEEP:
        others = [name for name in pixel_formats.ENCODINGS if name not in pixel_formats.DISTANCES]
        raise ParameterRefused(
            f"encoding = {wanted} is depth, but the source delivers {delivered}",
            f"{', '.join(others)}; depth only of grey pictures of 16 bits (PNG, TIFF, video) or "
            "of source = synthetic",
        )


class Converter:
    """Makes the frames of one camera."""

    def __init__(self) -> None:
        self._valid_epoch: int | None = None

    def frame(self, header: Header, picture: Picture, *, flip: str, quality: int) -> Frame:
        """Return the frame to publish under a header, in the encoding that the header names.

        A JPEG packet that needs no change is passed through unchanged, once a packet of its epoch
        has been decoded without a warning. Receivers refuse JPEGs with flaws, so if all packets
        of a source have flaws, they are decoded and encoded again.

        Raises:
            PayloadError: ``corrupt``, ``too_large``, or ``unsupported_encoding`` if depth is
                requested of a picture without depth.
        """
        if picture.width * picture.height > pixel_formats.MAX_PIXELS:
            raise PayloadError("too_large", f"{picture.width}x{picture.height} pixels")
        wanted = header.encoding or picture.encoding
        try:
            check_depth(picture.encoding, wanted)
        except ParameterRefused as refused:  # a folder may mix pictures of both kinds
            raise PayloadError("unsupported_encoding", refused.error) from None
        unchanged = is_unchanged(picture, wanted, flip)
        if picture.jpeg is not None and unchanged and self._is_valid(picture.jpeg, header.epoch):
            return Frame(header, compressed=picture.jpeg)
        if picture.stored is not None and unchanged and wanted not in pixel_formats.DEEP:
            return Frame(header, stored=picture.stored, quality=quality)
        return Frame(header, pixels=_pixels(picture, wanted, flip), quality=quality)

    def _is_valid(self, jpeg: bytes, epoch: int) -> bool:
        """Tell whether this packet, or an earlier one of its epoch, decoded without a warning."""
        if self._valid_epoch != epoch:
            try:
                codecs.decode_jpeg(jpeg, "mono8")
            except PayloadError:
                return False
            self._valid_epoch = epoch
        return True


def is_unchanged(picture: Picture, wanted: str, flip: str) -> bool:
    """Tell whether the JPEG of a picture can be published unchanged as its frame."""
    if wanted == "mono8" and picture.encoding != "mono8":
        return False
    return flip == "none" and wanted != "mono16"


def decoded(picture: Picture, encoding: str, least: tuple[int, int] = (0, 0)) -> Pixels:
    """Return the pixels of a picture of any form.

    Args:
        picture: Not modified.
        encoding: The encoding to which a JPEG is decoded; pixels are returned in the picture's own.
        least: Width and height that are enough; a JPEG may be decoded at a reduced scale.

    Raises:
        PayloadError: ``corrupt``.
    """
    if picture.stored is not None:
        return picture.stored.bgr()
    if picture.pixels is not None:
        return picture.pixels
    # Flaws that libjpeg can repair are accepted in a webcam's JPEG.
    return codecs.decode_jpeg(picture.jpeg or b"", encoding, least, strict=False)


def _pixels(picture: Picture, wanted: str, flip: str) -> Pixels:
    encoding = picture.encoding
    if picture.jpeg is not None:
        encoding = "mono8" if wanted in ("mono8", "mono16") else "bgr8"
    pixels = decoded(picture, encoding)
    if flip != "none":
        pixels = cv2.flip(pixels, FLIP_CODES[flip])  # type: ignore[assignment]
    return pixel_formats.convert(pixels, encoding, wanted)


def mirrored(tracks: tuple[Track, ...], flip: str, width: int, height: int) -> tuple[Track, ...]:
    """Return the tracks of a picture of this size, in pixels, after it was flipped."""
    sideways, upside_down = flip in ("horizontal", "both"), flip in ("vertical", "both")
    if not (sideways or upside_down):
        return tracks
    found = []
    for track in tracks:
        left, top, wide, high = track.box
        left = width - left - wide if sideways else left
        top = height - top - high if upside_down else top
        # The centre is rounded from the box's left and top, so it is not simply mirrored.
        changes = {
            "box": (left, top, wide, high),
            "x": float(left + int(wide / 2)),
            "y": float(top + int(high / 2)),
            "vx": -track.vx if sideways else track.vx,
            "vy": -track.vy if upside_down else track.vy,
        }
        found.append(track.model_copy(update=changes))
    return tuple(found)
