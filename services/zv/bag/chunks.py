"""Reads the records of an MCAP file, and its chunks, within bounds.

Nothing in a file is believed before it is checked: lengths against the size of the file, the
contents of a chunk against its CRC.
"""

from __future__ import annotations

import fcntl
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, Final

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from zv.bag.record import RecordingError
from zv.bag.writer import MAGIC

MAX_CHUNK_BYTES: Final = 256 << 20
"""Limit of a chunk, packed and unpacked; the largest raw picture has half of it."""

MAX_RECORD_BYTES: Final = 16 << 20
"""Limit of a schema, a channel or metadata."""

RECORD_HEAD: Final = struct.Struct("<BQ")
CHUNK_HEAD: Final = struct.Struct("<QQQII")
CHUNK_START: Final = RECORD_HEAD.size + CHUNK_HEAD.size + 8
"""Bytes before the contents of a chunk without compression."""

UNREADABLE: Final = (struct.error, McapError, UnicodeDecodeError, ValueError, EOFError, MemoryError)
"""What reading a record of random bytes raises."""


@dataclass(frozen=True, slots=True, order=True)
class ChunkPlace:
    """Where a chunk is.

    Attributes:
        offset: Of its record in the file.
        length: Of its record with the nine bytes before its contents.
        channels: The ids of the channels that it has messages of; None if that is unknown.
    """

    offset: int
    length: int
    first_ns: int
    last_ns: int
    channels: frozenset[int] | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Message:
    """A message in a chunk, which its view keeps in memory."""

    channel: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: memoryview


class ChunkFile:
    """An open file; reads what is asked for, never more than a chunk."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise RecordingError(f"cannot open {path}: {error.strerror}") from None
        self.path = path
        try:
            self.size = os.fstat(self._file).st_size
            magic = os.pread(self._file, len(MAGIC), 0)
        except OSError as error:
            self.close()
            raise RecordingError(f"cannot read {path}: {error.strerror}") from None
        if magic != MAGIC:
            self.close()
            found = f"not an MCAP file: it begins with {magic!r}" if magic else "empty"
            raise RecordingError(f"{path} is {found}")

    def close(self) -> None:
        """Close the file."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def is_locked(self) -> bool:
        """Return whether a process has it for itself, as a recorder has until it ends or dies."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            fcntl.flock(self._file, fcntl.LOCK_UN)
        except BlockingIOError:
            return True
        except OSError:  # a file system without locks
            pass
        return False

    def read(self, place: int, length: int) -> bytes:
        """Return bytes of the file.

        Raises:
            EOFError: It has fewer.
            OSError: It cannot be read.
        """
        if place < 0 or length < 0 or place + length > self.size:
            raise EOFError(f"{length} bytes at {place} are beyond the end")
        data = os.pread(self._file, length, place)
        while len(data) < length:
            more = os.pread(self._file, length - len(data), place + len(data))
            if not more:
                raise EOFError(f"{length} bytes at {place}: the file became shorter")
            data += more
        return data

    def head(self, place: int) -> tuple[int, int]:
        """Return the opcode of the record at a place, and its length after the nine bytes.

        Raises:
            EOFError: It is not whole.
        """
        opcode, length = RECORD_HEAD.unpack(self.read(place, RECORD_HEAD.size))
        if length > self.size - place - RECORD_HEAD.size:
            raise EOFError(f"the record at {place} ends after the file")
        return opcode, length

    def record(self, place: int, kind: Callable[[ReadDataStream], Any]) -> Any:
        """Return a record of a kind, such as ``Metadata.read``.

        Raises:
            UNREADABLE: It is none, or too large.
        """
        _, length = self.head(place)
        if length > MAX_RECORD_BYTES:
            raise ValueError(f"a record of {length} bytes")
        return kind(stream_of(self.read(place + RECORD_HEAD.size, length)))

    def chunk_at(self, place: int) -> ChunkPlace:
        """Return the chunk at a place.

        Raises:
            UNREADABLE: There is none, or it is not whole.
        """
        opcode, length = self.head(place)
        if opcode != Opcode.CHUNK:
            raise ValueError(f"no chunk is at {place}")
        head = self.read(place + RECORD_HEAD.size, CHUNK_HEAD.size)
        first_ns, last_ns, size, _, named = CHUNK_HEAD.unpack(head)
        if max(length, size) > MAX_CHUNK_BYTES or named > 16 or first_ns > last_ns:
            raise ValueError(f"the chunk at {place} has {max(length, size)} bytes")
        return ChunkPlace(place, RECORD_HEAD.size + length, first_ns, last_ns)

    def contents(self, chunk: ChunkPlace) -> memoryview:
        """Return the unpacked records of a chunk, whose CRC is checked.

        Raises:
            UNREADABLE: It is damaged or too large.
        """
        self.chunk_at(chunk.offset)
        data = memoryview(self.read(chunk.offset, chunk.length))[RECORD_HEAD.size :]
        _, _, size, crc, named = CHUNK_HEAD.unpack_from(data)
        compression = str(data[CHUNK_HEAD.size : CHUNK_HEAD.size + named], "utf-8")
        place = CHUNK_HEAD.size + named + 8
        (length,) = struct.unpack_from("<Q", data, place - 8)
        if length != len(data) - place:
            raise ValueError(f"the chunk at {chunk.offset} has a wrong length")
        unpacked = _unpacked(compression, data[place:], size)
        if len(unpacked) != size or (crc and zlib.crc32(unpacked) != crc):
            raise ValueError(f"the chunk at {chunk.offset} is damaged: its CRC is wrong")
        return unpacked

    def seems_chunk(self, head: bytes) -> bool:
        """Tell whether bytes can be the begin of a chunk without compression."""
        if len(head) < CHUNK_START:
            return False
        _, length = RECORD_HEAD.unpack_from(head)
        _, _, size, _, named = CHUNK_HEAD.unpack_from(head, RECORD_HEAD.size)
        return not named and length == size + CHUNK_HEAD.size + 8 and length <= self.size

    def is_chunk(self, place: int) -> bool:
        """Tell whether a whole chunk begins at a place."""
        try:
            self.contents(self.chunk_at(place))
        except UNREADABLE:
            return False
        return True


def stream_of(data: bytes | memoryview) -> ReadDataStream:
    """Return what the ``mcap`` package reads records from."""
    return ReadDataStream(BytesIO(data))


def records_in(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield opcode and contents of each record.

    Raises:
        EOFError: The last one is not whole.
    """
    place = 0
    while place < len(data):
        if place + RECORD_HEAD.size > len(data):
            raise EOFError("a record ends too early")
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place += RECORD_HEAD.size
        if length > len(data) - place:
            raise EOFError("a record ends too early")
        yield opcode, data[place : place + length]
        place += length


MESSAGE_HEAD: Final = struct.Struct("<HIQQ")


def message_of(record: memoryview) -> Message:
    """Return the message in a record.

    Raises:
        struct.error: It is too short.
    """
    channel, sequence, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(record)
    return Message(channel, sequence, log_ns, publish_ns, record[MESSAGE_HEAD.size :])


def _unpacked(compression: str, data: memoryview, size: int) -> memoryview:
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {size} bytes")
    try:
        if not compression:
            return data
        if compression == "zstd":
            unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES)
            with unpacker.stream_reader(data) as reader:
                return memoryview(reader.read(size + 1))
        if compression == "lz4":
            return memoryview(lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1))
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk cannot be unpacked: {error}") from None
    raise ValueError(f"compression {compression!r} is unknown; known are zstd, lz4 and none")
