"""One picture as it came over the network: its bytes, and who took it when."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import zenoh

from common.errors import ConfigurationError, ExpectationNotMet, PayloadError
from common.keys import JPEG, PNG, RAW_IMAGE
from common.messages import Header
from services.tools.types import type_of

JPEG_START, JPEG_END = b"\xff\xd8\xff", b"\xff\xd9"
PNG_START, PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xae\x42\x60\x82"
MAX_ATTACHMENT_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture.

    Attributes:
        key: Where it came from.
        mime: ``image/jpeg``, ``image/png``, or raw pixels.
        payload: JPEG, PNG or pixel rows.
        header: Its identity; None if its sender gave none.
    """

    key: str
    mime: str
    payload: bytes
    header: Header | None
    arrived_ns: int = field(default_factory=time.time_ns)

    @property
    def age_s(self) -> float | None:
        """From its capture to its arrival here; None without a header."""
        return None if self.header is None else (self.arrived_ns - self.header.stamp_ns) / 1e9

    def words(self) -> str:
        """Return who took it when, as text."""
        header = self.header
        if header is None or self.age_s is None:
            return f"{self.key}: no header, so neither identity nor age is known"
        return (
            f"{self.key}: {header.camera} epoch {header.epoch} seq {header.seq}, "
            f"{header.width}x{header.height} {header.encoding}, "
            f"by {header.node or 'someone'}, {self.age_s * 1e3:.1f} ms old"
        )

    def record(self) -> dict[str, Any]:
        """Return who took it when, for JSON."""
        return {
            "key": self.key,
            "age_ms": None if self.age_s is None else round(self.age_s * 1e3, 3),
            "header": None if self.header is None else self.header.to_map(),
        }


def shot_of(sample: zenoh.Sample) -> Shot:
    """Copy a picture out of Zenoh.

    Raises:
        ConfigurationError: The key carries something else.
        ExpectationNotMet: It is cut short, or its header cannot be read.
    """
    key, encoding = str(sample.key_expr), str(sample.encoding)
    payload = sample.payload.to_bytes()
    if encoding == RAW_IMAGE:
        mime = RAW_IMAGE
    elif payload.startswith(JPEG_START):
        mime = JPEG
    elif payload.startswith(PNG_START):
        mime = PNG
    else:
        kind = type_of(encoding)
        what = encoding if kind == "-" else kind
        raise ConfigurationError(
            f"{key} carries {what}, no picture; zv topic echo {key} --once shows it"
        )
    if not _is_whole(mime, payload):
        raise ExpectationNotMet(f"{key}: the picture is cut short ({len(payload)} bytes)")
    try:
        return Shot(key, mime, payload, _header(sample))
    except PayloadError as error:
        raise ExpectationNotMet(f"{key}: {error}") from None


def _header(sample: zenoh.Sample) -> Header | None:
    attachment = sample.attachment
    if attachment is None:
        return None
    if len(attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"{len(attachment)} bytes")
    return Header.from_bytes(attachment.to_bytes())


def _is_whole(mime: str, payload: bytes) -> bool:
    if mime == JPEG:
        return payload.rstrip(b"\0").endswith(JPEG_END)
    return mime != PNG or PNG_END in payload[-64:]
