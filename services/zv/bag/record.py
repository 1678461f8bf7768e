"""``Record``: one sample in a recording, as it arrived."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.message_codec import unpack

Origin = Literal["stream", "query"]
"""``stream``: it was published while the recorder listened. ``query``: it is a node's reply to the
recorder, which asked for what it had missed: descriptions, parameters, latched messages."""

MAX_HEADER_BYTES = 4096


@dataclass(frozen=True, slots=True)
class ZenohTime:
    """Zenoh's time stamp of a sample.

    Attributes:
        ntp64: Seconds since 1970 in units of 2^-32 s, with Zenoh's logical counter in the low bits.
        clock: Id of the session whose clock it is, in hexadecimal.
    """

    ntp64: int
    clock: str

    @property
    def ns(self) -> int:
        """Nanoseconds since 1970."""
        return (self.ntp64 * 1_000_000_000) >> 32

    @classmethod
    def parsed(cls, text: str) -> ZenohTime:
        """Return the time stamp that Zenoh writes as ``7712611875579270192/52cc5f86``.

        Raises:
            ValueError: The text is none.
        """
        number, _, clock = text.partition("/")
        return cls(int(number), clock)


@dataclass(frozen=True)
class Record:
    """One sample in a recording; its bytes are those that arrived.

    Attributes:
        key: Full key, without wildcards.
        encoding: Zenoh encoding.
        attachment: None if there was none, which differs from an empty one.
        timestamp: Zenoh's, if the sample had one.
        log_time_ns: When it arrived at the recorder, ns since 1970; does not decrease in a file.
        deleted: The key was deleted, not put.
        origin: Whether it was published, or asked for.
        priority: Zenoh's, 1 (real time) to 7 (background).
        drops: Whether Zenoh may drop it under congestion.
        express: Whether Zenoh sends it without waiting for others to batch with.
    """

    key: str
    payload: bytes = field(repr=False)
    encoding: str = ""
    attachment: bytes | None = field(default=None, repr=False)
    timestamp: ZenohTime | None = None
    log_time_ns: int = 0
    deleted: bool = False
    origin: Origin = "stream"
    priority: int = 5
    drops: bool = False
    express: bool = False

    @cached_property
    def header(self) -> dict[str, Any]:
        """The fields of the header in the attachment, unchecked; empty if there is none."""
        if not self.attachment or len(self.attachment) > MAX_HEADER_BYTES:
            return {}
        try:
            fields = unpack(self.attachment)
        except PayloadError:
            return {}
        return fields if isinstance(fields, dict) else {}

    def number(self, name: str) -> int | None:
        """Return a number of the header that fits into 64 bits; None if it has none such."""
        value = self.header.get(name)
        return value if type(value) is int and 0 <= value < 2**63 else None


class RecordingError(SourceError):
    """A file cannot be opened, is no recording, or cannot be read on; the text says which."""


class TooManyKeys(SourceError):
    """A file has no room for another key; the text names it."""


class ChunkLost(Exception):
    """A chunk could not be written, so its messages are lost; the file is as before it.

    Attributes:
        cause: What the operating system said.
        records: The samples in them.
    """

    def __init__(self, cause: OSError, records: list[Record]) -> None:
        super().__init__(f"{cause.strerror or cause}")
        self.cause = cause
        self.records = records
