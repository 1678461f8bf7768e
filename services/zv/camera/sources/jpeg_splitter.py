"""Finds the JPEGs in a stream of bytes, whatever is between them.

Servers disagree about boundaries, types and lengths of the parts of a multipart stream, and some
are wrong. A JPEG tells itself where it begins and ends: its segments have lengths, and its coded
data never contains the marker of an end or of another start.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from zenoh_vision.image.codecs import JPEG_START, MAX_COMPRESSED_BYTES

START_OR_END: Final = re.compile(rb"\xff[\xd8\xd9]")
START_OF_SCAN: Final = 0xDA
LEAST_MARKER: Final = 0xC0
MAX_HEAD_BYTES: Final = 4096
"""Bytes before a JPEG in which a time is looked for."""

TIMESTAMP: Final = re.compile(rb"x-timestamp:[ \t]*([0-9]{1,12}(?:\.[0-9]{1,9})?)", re.IGNORECASE)
"""The time of a picture on the camera's clock, seconds, as mjpg-streamer and others send it."""


@dataclass(frozen=True, slots=True)
class JpegPacket:
    """A JPEG as a server sent it.

    Attributes:
        data: The file.
        time_s: When it was captured, on any clock of the camera; None if it does not tell.
    """

    data: bytes
    time_s: float | None = None
    is_keyframe: bool = True

    @property
    def size(self) -> int:
        """Bytes."""
        return len(self.data)


class EndlessPicture(Exception):
    """A picture is larger than any that can be used, or has no end."""


class _NoHeaderError(Exception):
    """The bytes after the start of a JPEG are no header of one."""


class JpegSplitter:
    """Splits a stream into JPEGs, each as soon as its last byte is there.

    Attributes:
        cut: Number of pictures that were cut short: another one began in them.
    """

    def __init__(self) -> None:
        self.cut = 0
        self._bytes = bytearray()
        self._searched = 0  # up to here nothing was found
        self._scan: int | None = None  # where the coded data of the JPEG at the start begins
        self._time_s: float | None = None

    def feed(self, data: bytes) -> Iterator[JpegPacket]:
        """Add bytes, and yield the JPEGs that are complete with them.

        Raises:
            EndlessPicture: A picture is too large.
        """
        self._bytes += data
        while (packet := self._next()) is not None:
            yield packet
        if len(self._bytes) > MAX_COMPRESSED_BYTES:
            raise EndlessPicture

    def _next(self) -> JpegPacket | None:
        while True:
            if not self._bytes.startswith(JPEG_START) and not self._begin():
                return None
            if self._scan is None:
                try:
                    self._scan = self._scan_start()
                except _NoHeaderError:  # what follows may be a JPEG
                    self.cut += 1
                    self._drop(2)
                    continue
            if self._scan is None:
                return None
            found = START_OR_END.search(self._bytes, max(self._scan, self._searched))
            if found is None:
                self._searched = max(0, len(self._bytes) - 1)
                return None
            if found[0] == b"\xff\xd8":  # another one begins: this one was cut short
                self.cut += 1
                self._drop(found.start())
                continue
            packet = JpegPacket(bytes(self._bytes[: found.end()]), self._time_s)
            self._time_s = None
            self._drop(found.end())
            return packet

    def _begin(self) -> bool:
        """Drop what is before the next JPEG; return whether there is one."""
        start = self._bytes.find(JPEG_START, self._searched)
        head = bytes(self._bytes[: start if start >= 0 else None][-MAX_HEAD_BYTES:])
        times = TIMESTAMP.findall(head)
        self._time_s = float(times[-1]) if times else None
        if start >= 0:
            self._drop(start)
            return True
        self._drop(max(0, len(self._bytes) - MAX_HEAD_BYTES))
        self._searched = max(0, len(self._bytes) - len(JPEG_START) + 1)
        return False

    def _scan_start(self) -> int | None:
        """Return where the coded data begins; None if the header is not complete.

        Raises:
            _NoHeaderError: These are no segments.
        """
        position = 2
        while position + 4 <= len(self._bytes):
            if self._bytes[position] != 0xFF:
                raise _NoHeaderError
            marker = self._bytes[position + 1]
            if marker == 0xFF:  # a fill byte
                position += 1
                continue
            if marker < LEAST_MARKER:
                raise _NoHeaderError
            position += 2 + int.from_bytes(self._bytes[position + 2 : position + 4], "big")
            if marker == START_OF_SCAN:
                return position if position <= len(self._bytes) else None
        return None

    def _drop(self, count: int) -> None:
        del self._bytes[:count]
        self._searched = 0
        self._scan = None
