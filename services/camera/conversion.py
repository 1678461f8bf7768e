"""From a source's picture to the frame that is published: flip, encoding, or untouched."""

from __future__ import annotations

import cv2
import numpy as np
import simplejpeg

from common import images
from common.errors import PayloadError
from common.frame import Frame
from common.images import Pixels
from common.messages import Header, Track
from services.camera.sources.base import Picture

FLIP_CODES = {"horizontal": 1, "vertical": 0, "both": -1}


class Converter:
    """Makes the frames of one camera.

    Args:
        encoding: What the published pixels are.
        flip: ``none``, ``horizontal``, ``vertical`` or ``both``.
        quality: JPEG quality of what is encoded here.
    """

    def __init__(self, encoding: str, flip: str, quality: int) -> None:
        self._encoding = encoding
        self._flip = flip
        self._quality = quality
        self._sound_epoch: int | None = None

    def frame(self, header: Header, picture: Picture) -> Frame:
        """Return the frame to publish under a header.

        A JPEG packet that needs no change is passed through untouched, once one of the epoch
        has decoded without a flaw: receivers refuse flawed ones, so a source of which every
        packet has some is decoded and encoded anew.

        Raises:
            PayloadError: ``corrupt``, or ``too_large``.
        """
        if picture.width * picture.height > images.MAX_PIXELS:
            raise PayloadError("too_large", f"{picture.width}x{picture.height} pixels")
        if picture.jpeg is not None and self._passes_through(picture, picture.jpeg, header.epoch):
            return Frame(header, compressed=picture.jpeg)
        return Frame(header, pixels=self._pixels(picture), quality=self._quality)

    def _passes_through(self, picture: Picture, jpeg: bytes, epoch: int) -> bool:
        if self._flip != "none" or self._encoding == "mono16":
            return False
        if self._encoding == "mono8" and picture.encoding != "mono8":
            return False
        if self._sound_epoch != epoch:
            try:
                images.decode_jpeg(jpeg, "mono8")
            except PayloadError:
                return False
            self._sound_epoch = epoch
        return True

    def _pixels(self, picture: Picture) -> Pixels:
        pixels, encoding = picture.pixels, picture.encoding
        if pixels is None:
            encoding = "mono8" if self._encoding in ("mono8", "mono16") else "bgr8"
            pixels = decode_leniently(picture.jpeg or b"", encoding)
        if self._flip != "none":
            flipped: Pixels = cv2.flip(pixels, FLIP_CODES[self._flip])  # type: ignore[assignment]
            pixels = flipped
        return images.convert(pixels, encoding, self._encoding)


def mirrored(tracks: tuple[Track, ...], flip: str, width: int, height: int) -> tuple[Track, ...]:
    """Return where everything is in the picture that ``Converter`` makes with the same flip.

    Args:
        tracks: Where it is in the source's picture.
        flip: As for ``Converter``.
        width: Of the picture, pixels.
        height: Of the picture, pixels.
    """
    sideways, upside_down = flip in ("horizontal", "both"), flip in ("vertical", "both")
    if not (sideways or upside_down):
        return tracks
    found = []
    for track in tracks:
        left, top, wide, high = track.box
        left = width - left - wide if sideways else left
        top = height - top - high if upside_down else top
        # The centre is counted from the box's left and top, so it is not simply mirrored.
        changes = {
            "box": (left, top, wide, high),
            "x": float(left + int(wide / 2)),
            "y": float(top + int(high / 2)),
            "vx": -track.vx if sideways else track.vx,
            "vy": -track.vy if upside_down else track.vy,
        }
        found.append(track.model_copy(update=changes))
    return tuple(found)


def decode_leniently(jpeg: bytes, encoding: str) -> Pixels:
    """Return the pixels of a webcam's JPEG, forgiving what libjpeg can mend.

    Raises:
        PayloadError: ``corrupt``.
    """
    space = images.ENCODINGS[encoding].jpeg
    try:
        pixels = simplejpeg.decode_jpeg(jpeg, space, strict=False)
    except ValueError as error:
        raise PayloadError("corrupt", str(error)) from None
    return np.asarray(pixels[:, :, 0] if pixels.shape[2] == 1 else pixels, np.uint8)
