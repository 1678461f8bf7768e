"""What an MCAP file consists of: read from its summary, or found by walking over its records.

A summary is not believed before it is checked against its CRC, the size of the file and the chunks.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Header, MetadataIndex, Schema, Statistics

from zv.bag.chunks import (
    CHUNK_START,
    MAX_RECORD_BYTES,
    RECORD_HEAD,
    UNREADABLE,
    ChunkFile,
    ChunkPlace,
    records_in,
    stream_of,
)
from zv.bag.writer import MAGIC

MAX_SUMMARY_BYTES: Final = 256 << 20
FOOTER_BYTES: Final = 9 + 20 + len(MAGIC)
SEARCH_BYTES: Final = 1 << 20
MAX_TRIES: Final = 1_000_000
"""Most places at which the search for a chunk looks more closely."""

MAX_READ: Final = 4
"""How often the search may read a file as a whole, to check what seems to be a chunk."""

CUT_OFF: Final = "the last"
"""Begins the problem of a file which lacks nothing but its end."""

OUTSIDE: Final = range(Opcode.HEADER, Opcode.DATA_END + 1)
PRIVATE: Final = 0x80
"""Opcodes from here on are those of programs, and are skipped."""


@dataclass
class Index:
    """What a file consists of.

    Attributes:
        closed: It has a summary, so it was closed.
        metadata_places: Where metadata are.
        end: Where the readable part ends.
        loose: Number of messages outside of chunks.
        problems: What is wrong with it.
    """

    profile: str = ""
    library: str = ""
    closed: bool = False
    chunks: list[ChunkPlace] = field(default_factory=list)
    metadata_places: list[int] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    statistics: Statistics | None = None
    end: int = 0
    loose: int = 0
    problems: list[str] = field(default_factory=list)

    def note(self, opcode: int, record: memoryview) -> None:
        """Note one record of the summary, or one outside of the chunks."""
        stream = stream_of(record)
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels[channel.id] = channel
        elif opcode == Opcode.STATISTICS:
            self.statistics = Statistics.read(stream)
        elif opcode == Opcode.METADATA_INDEX:
            self.metadata_places.append(MetadataIndex.read(stream).offset)
        elif opcode == Opcode.CHUNK_INDEX:
            found = ChunkIndex.read(stream)
            self.chunks.append(
                ChunkPlace(
                    found.chunk_start_offset,
                    found.chunk_length,
                    found.message_start_time,
                    found.message_end_time,
                    frozenset(found.message_index_offsets) or None,
                )
            )


def index_of(file: ChunkFile) -> Index:
    """Return what a file consists of, by its summary, or else by walking over it.

    Raises:
        OSError: The disk failed.
    """
    try:
        found = _summary(file)
    except UNREADABLE as error:
        found = _walk(file)
        # That a file was not closed is no problem of its own, but a broken index is one.
        if not isinstance(error, EOFError):
            found.problems.insert(0, f"no usable index: {error or 'it is damaged'}")
    try:
        header: Header = file.record(len(MAGIC), Header.read)
        found.profile, found.library = header.profile, header.library
    except UNREADABLE as error:
        found.problems.append(f"its header is unreadable: {error}")
    return found


def _summary(file: ChunkFile) -> Index:
    """Return what the summary says.

    Raises:
        UNREADABLE: There is none, or it is not to be believed.
    """
    found = Index()
    start, data = _summary_bytes(file)
    for opcode, record in records_in(data):
        found.note(opcode, record)
    found.chunks = sorted({each.offset: each for each in found.chunks}.values())
    _check(file, found.chunks, start)
    found.end, found.closed = file.size, True
    return found


def _summary_bytes(file: ChunkFile) -> tuple[int, memoryview]:
    """Return where the summary begins, and its records.

    Raises:
        UNREADABLE: There is none, or its CRC is wrong.
    """
    if file.read(file.size - len(MAGIC), len(MAGIC)) != MAGIC:
        raise EOFError("the file was not closed")
    place = file.size - FOOTER_BYTES
    opcode, length = file.head(place)
    if opcode != Opcode.FOOTER or length != 20:
        raise ValueError("it has no footer")
    start, _, crc = struct.unpack("<QQI", file.read(place + RECORD_HEAD.size, 20))
    if not len(MAGIC) < start <= place:
        raise ValueError("its footer names no summary")
    if place - start > MAX_SUMMARY_BYTES:
        raise ValueError(f"a summary of {place - start} bytes")
    data = file.read(start, place - start + RECORD_HEAD.size + 16)  # the CRC is of these
    if crc and zlib.crc32(data) != crc:
        raise ValueError("the CRC of the summary is wrong")
    return start, memoryview(data)[: place - start]


def _check(file: ChunkFile, chunks: Sequence[ChunkPlace], end: int) -> None:
    """Check an index against the file.

    Raises:
        UNREADABLE: It names other places than chunks, before ``end``, one after the other.
    """
    place = len(MAGIC)
    for each in chunks:
        if each.offset < place or each.length < CHUNK_START or each.first_ns > each.last_ns:
            raise ValueError("its index names chunks that overlap or are none")
        place = each.offset + each.length
    if place > end:
        raise ValueError("its index names places after the data")
    for each in (*chunks[:1], *chunks[-1:]):
        if file.chunk_at(each.offset) != each:
            raise ValueError("its index does not match its chunks")


def _walk(file: ChunkFile) -> Index:
    """Walk from record to record; after a damaged part, search for the next chunk."""
    found, search = Index(), _Search(file)
    place = len(MAGIC)
    while place < file.size:
        try:
            opcode, length = file.head(place)
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            _note_at(file, found, place, opcode)
            place += RECORD_HEAD.size + length
            found.end = place
        except UNREADABLE as error:
            resumed = search.next_chunk(place + 1)
            if resumed is None:
                rest = file.size - place
                found.problems.append(f"{CUT_OFF} {rest} bytes are not readable: {error}")
                break
            found.problems.append(f"{resumed - place} bytes at {place} are damaged: {error}")
            place = resumed
    _cut_torn(file, found)
    return found


def _cut_torn(file: ChunkFile, found: Index) -> None:
    """Leave out the last chunks if they are not whole.

    After a power cut, a file may have zeros in place of what had not reached the disk.
    """
    size = len(found.chunks)
    while found.chunks and not file.is_chunk(found.chunks[-1].offset):
        found.end = found.chunks.pop().offset
    if len(found.chunks) < size:
        found.metadata_places = [each for each in found.metadata_places if each < found.end]
        found.problems = [each for each in found.problems if not each.startswith(CUT_OFF)]
        found.problems.append(f"{CUT_OFF} {file.size - found.end} bytes are not readable: torn")


def _note_at(file: ChunkFile, found: Index, place: int, opcode: int) -> None:
    """Note the record at a place.

    Raises:
        UNREADABLE: It is none.
    """
    if opcode == Opcode.CHUNK:
        found.chunks.append(file.chunk_at(place))
    elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        _, length = file.head(place)
        body = file.read(place + RECORD_HEAD.size, min(length, MAX_RECORD_BYTES))
        found.note(opcode, memoryview(body))
    elif opcode == Opcode.METADATA:
        found.metadata_places.append(place)
    elif opcode == Opcode.MESSAGE:
        found.loose += 1
    elif opcode not in OUTSIDE and opcode < PRIVATE:
        raise ValueError(f"{opcode} is no kind of record")


class _Search:
    """Searches for chunks after damage, without reading much more than the file has.

    Only chunks without compression are found, since their lengths agree with each other.
    """

    def __init__(self, file: ChunkFile) -> None:
        self._file = file
        self._tries = MAX_TRIES
        self._bytes = MAX_READ * file.size + SEARCH_BYTES

    def next_chunk(self, place: int) -> int | None:
        """Return where the next whole chunk begins from a place on; None if there is none."""
        while place <= self._file.size - CHUNK_START:
            block = self._file.read(place, min(SEARCH_BYTES, self._file.size - place))
            at = block.find(Opcode.CHUNK)
            while at >= 0:
                head = block[at : at + CHUNK_START]
                self._tries -= 1
                if self._file.seems_chunk(head):
                    self._bytes -= len(head) + RECORD_HEAD.unpack_from(head)[1]
                    if self._bytes >= 0 and self._file.is_chunk(place + at):
                        return place + at
                if self._tries <= 0 or self._bytes < 0:
                    return None
                at = block.find(Opcode.CHUNK, at + 1)
            place += max(1, len(block) - CHUNK_START + 1)
        return None
