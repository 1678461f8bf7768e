"""What a sample says, as plain values: a message's fields, a picture's header, size and format."""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass, field
from typing import Any

import msgpack
import zenoh

from common.codec import MAX_MESSAGE_BYTES, unpack
from common.errors import PayloadError
from services.tools.types import schema_of

MSGPACK = "application/msgpack"
TEXTS = ("text/", "zenoh/string", "application/json")
MAX_TEXT_BYTES = 64 << 10
MAX_ATTACHMENT_BYTES = 4096
MAX_DEPTH = 32


@dataclass(frozen=True, slots=True)
class Received:
    """A sample, copied out of Zenoh; of a picture only what is told of it.

    Attributes:
        payload: None where only the size is of interest.
        size: Bytes of the payload.
    """

    key: str
    encoding: str
    attachment: bytes | None
    payload: bytes | None
    size: int
    deleted: bool = False
    received_ns: int = field(default_factory=time.time_ns)

    @property
    def is_picture(self) -> bool:
        """Whether it is a picture, compressed or raw."""
        return self.encoding.startswith("image/") or schema_of(self.encoding) == "vision.Image.v1"


def received(sample: zenoh.Sample) -> Received:
    """Copy a sample out of Zenoh: quick enough for Zenoh's own thread."""
    encoding, size = str(sample.encoding), len(sample.payload)
    attachment = sample.attachment
    kept = None if attachment is None or len(attachment) > MAX_ATTACHMENT_BYTES else attachment
    picture = encoding.startswith("image/") or "vision.Image" in encoding
    whole = size <= MAX_MESSAGE_BYTES and not (picture and kept is not None)
    return Received(
        str(sample.key_expr),
        encoding,
        None if kept is None else kept.to_bytes(),
        sample.payload.to_bytes() if whole else None,
        size,
        deleted=sample.kind == zenoh.SampleKind.DELETE,
    )


def fields_of(sample: Received, *, header: bool = True) -> dict[str, Any]:
    """Return what a sample says, by field; values are those of JSON.

    Args:
        sample: Of any kind.
        header: Whether to have the header's fields too.
    """
    if sample.deleted:
        return {"deleted": True}
    if sample.is_picture:
        found = picture_fields(sample)
    elif sample.encoding.startswith(MSGPACK) or _is_ours(sample):
        found = message_fields(sample)
    else:
        found = foreign_fields(sample)
    if not header:
        found.pop("header", None)
    return found


def message_fields(sample: Received) -> dict[str, Any]:
    """Return the fields of a msgpack message; what is wrong with it where it cannot be read."""
    try:
        if sample.payload is None:
            raise PayloadError("bad_message", f"{sample.size} bytes")
        found = plain(unpack(sample.payload))
    except PayloadError as error:
        return {"unreadable": error.detail, "bytes": sample.size}
    return found if isinstance(found, dict) else {"value": found}


def picture_fields(sample: Received) -> dict[str, Any]:
    """Return a picture's header, format, size in pixels and in bytes."""
    header = header_fields(sample)
    form = sample.encoding.removeprefix("image/")
    raw = not sample.encoding.startswith("image/")
    found: dict[str, Any] = {} if header is None else {"header": header}
    found["format"] = "raw" if raw else form
    found["width"], found["height"] = _size(sample, header)
    found["encoding"] = None if header is None else header.get("encoding")
    found["bytes"] = sample.size
    return found


def header_fields(sample: Received) -> dict[str, Any] | None:
    """Return the attachment's map; None if there is none that can be read."""
    if sample.attachment is None:
        return None
    try:
        header = plain(unpack(sample.attachment))
    except PayloadError:
        return None
    return header if isinstance(header, dict) else None


def foreign_fields(sample: Received) -> dict[str, Any]:
    """Return a text or JSON of others as it is, of other payloads the size."""
    header = header_fields(sample)
    found: dict[str, Any] = {} if header is None else {"header": header}
    payload = sample.payload
    if payload is not None and sample.encoding.startswith(TEXTS) and sample.size <= MAX_TEXT_BYTES:
        text = payload.decode(errors="replace")
        if sample.encoding.startswith("application/json"):
            try:
                value = plain(json.loads(text))
            except (ValueError, RecursionError):
                value = text
            return found | (value if isinstance(value, dict) else {"value": value})
        return {**found, "text": text}
    return {**found, "encoding": sample.encoding, "bytes": sample.size}


def plain(value: object, depth: int = 0) -> Any:
    """Return a decoded value in the terms of JSON; what is nested too deep is left out."""
    if depth > MAX_DEPTH:
        return "..."
    if isinstance(value, dict):
        return {str(name): plain(each, depth + 1) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each, depth + 1) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    return str(value)


def _is_ours(sample: Received) -> bool:
    """Tell whether a payload without a telling encoding is a message all the same."""
    if sample.encoding not in ("zenoh/bytes", "application/octet-stream"):
        return False
    if sample.payload is None or sample.payload[:1] < b"\x80":
        return False
    try:
        return isinstance(msgpack.unpackb(sample.payload), dict)
    except (ValueError, TypeError, msgpack.UnpackException):
        return False


def _size(sample: Received, header: dict[str, Any] | None) -> tuple[int | None, int | None]:
    """Return width and height: by the header, else by the picture's own."""
    if header is not None:
        return header.get("width"), header.get("height")
    if sample.payload is None or not sample.encoding.startswith("image/"):
        return None, None
    from common.images import picture_size  # takes a fifth of a second

    try:
        return picture_size(sample.payload)
    except PayloadError:
        return None, None
