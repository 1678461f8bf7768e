"""A sample as it arrived by any transport: Zenoh, shared memory, a recording or a test."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.limits import MAX_RAW_BYTES
from zenoh_vision.keys import RouteName
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES

MAX_ATTACHMENT_BYTES = 4096
"""Limit of an attachment, many times the size of a header."""


@dataclass(frozen=True, slots=True)
class SizeLimit:
    """The most bytes of a payload, and the reason under which a larger one is dropped.

    ``by_encoding`` has the Zenoh encodings that have another limit.
    """

    max_bytes: int
    reason: str = "too_large"
    by_encoding: Mapping[str, int] = field(default_factory=dict)

    def check(self, size: int, encoding: str = "") -> None:
        """Check a payload's size in bytes; a transport does so before it copies the payload.

        Raises:
            PayloadError: It is over the limit.
        """
        most = self.by_encoding.get(encoding, self.max_bytes)
        if size > most:
            raise PayloadError(self.reason, f"{size} bytes, at most {most} are allowed")


MESSAGE_LIMIT = SizeLimit(MAX_MESSAGE_BYTES, "bad_message")
RAW_LIMIT = SizeLimit(MAX_RAW_BYTES)


@dataclass(slots=True)
class Sample:
    """One arrival on one key, never changed. A frozen class takes three times as long to make.

    Attributes:
        key: Full key, without wildcards.
        payload: Bytes, or a read-only ``memoryview`` of memory that does not change while something
            refers to it.
        encoding: Zenoh encoding; empty if unknown.
        attachment: Bytes of the header, if any.
        arrived_ns: Monotonic time of arrival.
        received_ns: Wall-clock time of arrival, since 1970.
        deleted: The key was deleted, not put; the payload is empty.
        route: How it came.
    """

    key: str
    payload: bytes | memoryview
    encoding: str = ""
    attachment: bytes | None = None
    arrived_ns: int = field(default_factory=time.monotonic_ns)
    received_ns: int = field(default_factory=time.time_ns)
    deleted: bool = False
    route: RouteName = "jpeg"
