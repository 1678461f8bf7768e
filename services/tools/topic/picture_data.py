"""Pictures to send: an image file, decoded once to be sure that it is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import simplejpeg

from common import images
from common.errors import ConfigurationError, PayloadError
from common.keys import JPEG, PNG, RAW_IMAGE, Topic
from common.publishing import Sample
from services.tools.topic.headers import new_header
from services.tools.types import camera_of


@dataclass(slots=True)
class PictureFile:
    """A picture that is sent as it is.

    Attributes:
        payload: On the wire.
        mime: Zenoh encoding.
        encoding: What the pixels are.
        camera: Of the key.
        size: Width and height.
    """

    payload: bytes
    mime: str
    encoding: str
    camera: str
    size: tuple[int, int] | None

    def make(self, seq: int, epoch: int) -> Sample:
        """Return the picture with a new header."""
        header = new_header(self.camera, epoch, seq, self.size or (1, 1), self.encoding)
        return Sample(self.payload, self.mime, header.to_bytes())


def picture_data(key: str, topic: Topic, file: bytes) -> PictureFile:
    """Return what sends an image file: JPEG and PNG as they are, any other form encoded anew.

    Raises:
        ConfigurationError: The file holds no picture that can be sent there.
    """
    try:
        if file.startswith((images.JPEG_START, images.PNG_START)):
            images.picture_size(file)
            is_png = file.startswith(images.PNG_START)
            pixels = images.decode_png(file) if is_png else _pixels_of_jpeg(file)
        else:
            found = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)
            if found is None:
                raise PayloadError("not_an_image", "neither JPEG, PNG nor another known form")
            pixels = found
            file = b""
        encoding = _encoding_of(pixels)
    except (PayloadError, cv2.error) as error:
        why = error.detail if isinstance(error, PayloadError) else "it cannot be decoded"
        raise ConfigurationError(f"DATA is no picture for {key}: {why}") from None
    height, width = pixels.shape[:2]
    if topic.encoding == RAW_IMAGE:
        payload, mime = images.to_raw(pixels, encoding), RAW_IMAGE
    elif file:
        payload, mime = file, PNG if file.startswith(images.PNG_START) else JPEG
    elif encoding == "mono16" or topic.encoding == PNG:
        payload, mime = images.encode_png(pixels), PNG
    else:
        payload, mime = images.encode_jpeg(pixels, encoding, 90), JPEG
    return PictureFile(payload, mime, encoding, camera_of(key), (width, height))


def _pixels_of_jpeg(jpeg: bytes) -> Any:
    *_, space, _ = simplejpeg.decode_jpeg_header(jpeg)
    return images.decode_jpeg(jpeg, "mono8" if space == "Gray" else "bgr8")


def _encoding_of(pixels: Any) -> str:
    """Return the encoding's name of decoded pixels.

    Raises:
        PayloadError: There is none.
    """
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    names = {(1, "uint8"): "mono8", (1, "uint16"): "mono16"}
    names |= {(3, "uint8"): "bgr8", (4, "uint8"): "bgra8"}
    name = names.get((channels, str(pixels.dtype)))
    if name is None:
        raise PayloadError(
            "unsupported_encoding",
            f"{channels} channels of {pixels.dtype}; allowed are 1, 3 or 4 of uint8, 1 of uint16",
        )
    return name
