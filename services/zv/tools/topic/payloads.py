"""Makes the samples of ``zv topic pub`` from JSON or an image file, by the topic's type.

The header of each sample is made when it is sent, since a stamp, epoch or number given earlier
would be wrong by then.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import msgpack
import numpy as np
import simplejpeg

from zenoh_vision.error_text import did_you_mean, joined, similar_names
from zenoh_vision.errors import ConfigurationError, PayloadError, SourceError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import JPEG, PNG, RAW_IMAGE, camera_of, is_name, msgpack_of
from zenoh_vision.messages import Header
from zenoh_vision.topics import TOPICS, Topic, topic_of
from zenoh_vision.transport.publisher import Outgoing
from zv.tools.shared.message_types import MessageType, known_type

SENDER = "topic_pub"
MADE_HERE = ("epoch", "seq", "stamp_ns", "received_ns", "done_ns", "node", "revision", "assumed")
"""Fields of the header that the user cannot give."""

JPEG_QUALITY = 90


@dataclass(slots=True)
class Payload:
    """A message or a picture that is sent with a new header each time.

    Attributes:
        make: Returns the sample for a header; the header is None if ``camera`` is None.
        camera: The camera in the key; None for a message without a header.
        size: Width and height of the frame; None if unknown.
        encoding: Format of a picture's decoded pixels.
    """

    make: Callable[[Header | None], Outgoing]
    camera: str | None
    size: tuple[int, int] | None
    encoding: str | None = None

    @property
    def needs_size(self) -> bool:
        """Whether the header needs a frame size that is not known yet."""
        return self.camera is not None and self.size is None

    def sample(self, seq: int, epoch: int) -> Outgoing:
        """Return the sample with a header of the current time.

        Raises:
            ConfigurationError: It does not match its type, or its size is out of range.
        """
        if self.camera is None:
            return self.make(None)
        width, height = self.size or (1, 1)
        fields = {"camera": self.camera, "epoch": epoch, "seq": seq, "stamp_ns": time.time_ns()}
        fields |= {"width": width, "height": height, "encoding": self.encoding, "node": SENDER}
        try:
            return self.make(Header.from_map(fields))
        except PayloadError as error:
            raise ConfigurationError(error.detail) from None


def payload_for(key: str, data: str, message: MessageType | None) -> Payload:
    """Return the payload for a key, from JSON, a file or standard input (``-``).

    ``message`` None is the type of the key's topic.

    Raises:
        ConfigurationError: The key has no type, or the data does not match it.
        SourceError: The file cannot be read.
    """
    topic = topic_of(key)
    if message is None and topic is not None and topic.message is not None:
        message = known_type(topic.message)
    if message is not None:
        return _message_payload(key, message, data)
    if topic is not None:
        return _picture_payload(key, topic, _read(data))
    suffixes = sorted(topic.name for topic in TOPICS.values())
    near = similar_names(key.split("/", 2)[-1], suffixes)
    hint = did_you_mean([f".../{each}" for each in near], after=" If not, ")
    raise ConfigurationError(
        f"{key} is not in the topic table, and no running node says what it carries: {hint}"
        f"name one with --type, or take one of .../{', .../'.join(suffixes)}"
    )


def _read(data: str) -> bytes:
    if data == "-":
        return sys.stdin.buffer.read()
    try:
        return Path(data).read_bytes()
    except (OSError, ValueError) as error:
        raise SourceError(f"{data}: {getattr(error, 'strerror', None) or error}") from None


# Messages


def _message_payload(key: str, message: MessageType, data: str) -> Payload:
    fields = _json(data)
    if not isinstance(fields, dict):
        raise ConfigurationError(f"a {message.short_name} is a JSON object, not {data[:40]!r}")
    if unknown := [name for name in fields if name not in message.fields]:
        raise ConfigurationError(
            f"{message.short_name} has no field {unknown[0]!r}; "
            f"its fields: {joined(message.fields)}"
        )
    camera = size = None
    if message.stamped:
        camera, size = _given_header(key, fields.pop("header", {}))

    def make(header: Header | None) -> Outgoing:
        try:
            made = message.checked(fields | ({"header": header.to_map()} if header else {}))
            packed = bytes(msgpack.packb(made))
        except PayloadError as error:
            names = joined(name for name in message.fields if name != "header")
            raise ConfigurationError(f"{error.detail}; its fields: {names}") from None
        except (ValueError, TypeError, OverflowError) as error:
            raise ConfigurationError(f"DATA cannot be sent as msgpack: {error}") from None
        attachment = header.to_bytes() if header else None
        return Outgoing(packed, msgpack_of(message.schema_name), attachment)

    payload = Payload(make, camera, size)
    payload.sample(0, 0)  # report wrong fields without a router
    return payload


def _given_header(key: str, header: Any) -> tuple[str, tuple[int, int] | None]:
    """Return the camera, and the frame size if the user's header states it."""
    if not isinstance(header, dict):
        raise ConfigurationError(f"header must be a JSON object, not {header!r:.40}")
    if written := [name for name in header if name in MADE_HERE]:
        raise ConfigurationError(
            f"header.{written[0]} is made when the message is sent: leave it out"
        )
    camera = camera_of(key) if key.count("/") > 1 else str(header.get("camera", ""))
    if header.get("camera", camera) != camera:
        raise ConfigurationError(f"header.camera is {header['camera']!r} on a key of {camera}")
    if not is_name(camera):
        raise ConfigurationError(f"{camera!r} is not a camera name: allowed are a-z, 0-9 and _")
    if "width" not in header or "height" not in header:
        return camera, None
    return camera, (header["width"], header["height"])


def _json(data: str) -> Any:
    """Return the JSON in a text, a file or standard input, with tuples for lists."""
    place, text = "DATA", data
    if data.lstrip()[:1] not in ("{", "["):
        try:
            place, text = data, _read(data).decode(errors="replace")
        except SourceError as error:
            raise SourceError(f"{error}; DATA is JSON in braces, a JSON file, or -") from None
    try:
        return _tuples(json.loads(text))
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{place}: not JSON: {error}") from None


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _tuples(each) for name, each in value.items()}
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value


# Pictures


def _picture_payload(key: str, topic: Topic, file: bytes) -> Payload:
    """Return a picture to send: JPEG and PNG files unchanged, others encoded."""
    try:
        pixels, encoding = _decoded(file)
    except (PayloadError, cv2.error) as error:
        why = error.detail if isinstance(error, PayloadError) else "it cannot be decoded"
        raise ConfigurationError(f"DATA is not a picture for {key}: {why}") from None
    if topic.encoding == RAW_IMAGE:
        payload, mime = pixel_formats.to_raw(pixels, encoding), topic.encoding
    elif kind := codecs.picture_type(file):
        payload, mime = file, kind
    elif encoding == "mono16" or topic.encoding == PNG:
        payload, mime = codecs.encode_png(pixels), PNG
    else:
        payload, mime = codecs.encode_jpeg(pixels, encoding, JPEG_QUALITY), JPEG
    height, width = pixels.shape[:2]

    def make(header: Header | None) -> Outgoing:
        return Outgoing(payload, mime, header.to_bytes() if header else None)

    return Payload(make, camera_of(key), (width, height), encoding)


def _decoded(file: bytes) -> tuple[Pixels, str]:
    """Return the pixels and encoding of an image file, strictly checked if sent unchanged."""
    kind = codecs.picture_type(file)
    if kind is not None:
        codecs.picture_size(file)
    if kind == PNG:
        pixels = codecs.decode_png(file)
    elif kind == JPEG:
        *_, space, _ = simplejpeg.decode_jpeg_header(file)
        pixels = codecs.decode_jpeg(file, "mono8" if space == "Gray" else "bgr8")
    else:
        found: Any = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)
        if found is None:
            raise PayloadError("not_an_image", "neither JPEG, PNG nor another known format")
        pixels = found
    return pixels, pixel_formats.encoding_of(pixels)
