"""Samples of any program, copied out of Zenoh on its own thread."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import is_picture, schema_name_of
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.messages import Header
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES


@dataclass(frozen=True, slots=True)
class Received:
    """A sample, copied out of Zenoh, with the time of its arrival.

    Attributes:
        payload: None where only its size is of interest.
        size: Bytes of the payload.
        received_ns: Wall-clock time of arrival, since 1970.
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
        return is_picture(self.encoding)

    @property
    def kind(self) -> str:
        """The schema name of a message, or else the encoding."""
        return schema_name_of(self.encoding) or self.encoding


def received(sample: zenoh.Sample, *, payload: bool = True) -> Received:
    """Copy a sample out of Zenoh; quick enough for Zenoh's own thread.

    Args:
        sample: Any sample.
        payload: Copy the payload too, unless it is that of a picture with a header, or larger
            than a message may be.
    """
    attachment = sample.attachment
    if attachment is not None and len(attachment) > MAX_ATTACHMENT_BYTES:
        attachment = None
    encoding, size = str(sample.encoding), len(sample.payload)
    whole = payload and size <= MAX_MESSAGE_BYTES
    whole = whole and (attachment is None or not is_picture(encoding))
    return Received(
        str(sample.key_expr),
        encoding,
        None if attachment is None else attachment.to_bytes(),
        sample.payload.to_bytes() if whole else None,
        size,
        deleted=sample.kind == zenoh.SampleKind.DELETE,
    )


def header_of(attachment: bytes | None) -> Header | None:
    """Return the header in an attachment; None if there is none, or it is something else."""
    if attachment is None or len(attachment) > MAX_ATTACHMENT_BYTES:
        return None
    try:
        return Header.from_bytes(attachment)
    except PayloadError:
        return None
