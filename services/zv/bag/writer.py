"""Writes MCAP files that are readable at every moment up to the last closed chunk.

The records are those of the ``mcap`` package. Its own writer keeps a chunk until it is large, with
no way to close it after a time, and cannot go on after a full disk.
"""

from __future__ import annotations

import fcntl
import os
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Statistics,
    SummaryOffset,
)
from mcap.records import Schema as SchemaRecord

from zv.bag.layout import encoded
from zv.bag.record import ChunkLost, Record, RecordingError, TooManyKeys
from zv.bag.renaming import rename_new, sync_folder
from zv.bag.schemas import ACCOUNT, CHANNEL_KIND, Schema

MAGIC: Final = b"\x89MCAP0\r\n"
PARTIAL: Final = ".partial"
"""Ends the name of a file that is not closed."""

CHUNK_BYTES: Final = 4 << 20
MESSAGE_HEAD: Final = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time of a message."""
CHUNK_HEAD: Final = struct.Struct("<BQQQQIIQ")
"""Opcode, length, first and last time, size, CRC, length of the compression's name, data length."""
FOOTER: Final = struct.Struct("<BQQQ")

MAX_CHANNELS: Final = 65_000
"""Their ids have 16 bits."""

MOST_BUFFERS: Final = 1024
"""Most buffers of one call to ``writev``."""

ABOUT: Final = "zenoh_vision"
"""Name of the metadata that say what the file is."""

ORIGIN: Final = "zenoh_origin"
"""Name in a channel's metadata: whether its samples were published, or asked for."""

PRIVATE: Final = 0o600


def record_bytes(*records: McapRecord) -> bytes:
    """Return records as they stand in a file."""
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


class _Chunk:
    """The messages since the last chunk was written, not copied."""

    def __init__(self) -> None:
        self.buffers: list[bytes] = []
        self.size = 0
        self.crc = 0
        self.first_ns = self.last_ns = 0
        self.index: dict[int, list[tuple[int, int]]] = {}
        self.schemas: set[int] = set()
        self.records: list[Record] = []

    def append(self, data: bytes) -> None:
        self.buffers.append(data)
        self.crc = zlib.crc32(data, self.crc)
        self.size += len(data)

    def note(self, channel: int, log_ns: int) -> None:
        if not self.index:
            self.first_ns = self.last_ns = log_ns
        self.first_ns, self.last_ns = min(self.first_ns, log_ns), max(self.last_ns, log_ns)
        self.index.setdefault(channel, []).append((log_ns, self.size))


class Writer:
    """Writes one file. It is named ``path`` plus ``.partial`` until ``close``.

    Args:
        path: The name of the closed file, which must not exist.
        about: What the file's metadata say about it.
        mode: Permissions; by default for its owner only.
        profile: The MCAP profile in its header: ``ros2`` or nothing.
        chunk_bytes: A chunk of this many bytes is written.

    Attributes:
        size: Bytes that are written.

    Raises:
        RecordingError: There is such a file already, it cannot be made, or the path names none.
    """

    def __init__(
        self,
        path: Path,
        about: Mapping[str, str] | None = None,
        *,
        mode: int = PRIVATE,
        profile: str = "",
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        if not path.name:
            raise RecordingError(f"{path} is a folder; allowed: the name of a file")
        self.path = path
        self.partial = path.with_name(path.name + PARTIAL)
        self._begin(chunk_bytes)
        for each in (path, self.partial):
            if each.exists() or each.is_symlink():
                hint = ""
                if each == self.partial:
                    hint = "; `zv bag repair` completes it, unless a recorder still writes it"
                raise RecordingError(f"{each} exists already, and is not overwritten{hint}")
        try:
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            self._file = os.open(self.partial, flags, mode)
        except OSError as error:
            raise RecordingError(f"cannot make {self.partial}: {error.strerror}") from None
        try:
            with suppress(OSError):  # a file system without locks
                self._lock()
            os.fchmod(self._file, mode)  # whatever the umask says
            self._write([MAGIC, record_bytes(Header(profile, "zenoh-vision"))])
            if about:
                self.add_metadata(ABOUT, about)
        except OSError as error:
            self.discard()
            raise RecordingError(f"cannot write {self.partial}: {error.strerror}") from None

    def _begin(self, chunk_bytes: int) -> None:
        self._file = -1
        self._chunk_bytes = chunk_bytes
        self.size = self._synced = 0
        self._is_named = False
        self._counts: Counter[int] = Counter()
        self._schemas: dict[str, SchemaRecord] = {}
        self._channels: dict[tuple[str, str, str], Channel] = {}
        self._last_id = 0  # of a channel
        self._chunk = _Chunk()
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._last = self._chunk

    @classmethod
    def resumed(cls, partial: Path, path: Path) -> Self:
        """Return a writer for a file that was not closed, whose chunks are then adopted.

        Raises:
            RecordingError: It cannot be written, another process writes it, or there is a file of
                the final name.
        """
        if path != partial and path.exists():
            raise RecordingError(f"{path} exists already, and is not overwritten")
        self = cls.__new__(cls)
        self.path, self.partial = path, partial
        self._begin(CHUNK_BYTES)
        try:
            self._file = os.open(partial, os.O_RDWR | os.O_CLOEXEC)
            self.size = os.fstat(self._file).st_size
        except OSError as error:
            raise RecordingError(f"cannot write {partial}: {error.strerror}") from None
        try:
            self._lock()
        except BlockingIOError:
            self.abandon()
            raise RecordingError(
                f"{partial} is being written: end the recorder first, which completes it"
            ) from None
        except OSError:
            pass  # a file system without locks
        return self

    def _lock(self) -> None:
        """Have the file for this process alone, until it is closed or the process dies.

        Raises:
            BlockingIOError: Another one has it.
            OSError: The file system has no locks.
        """
        fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def adopt(
        self,
        place: tuple[int, int],
        schemas: Iterable[SchemaRecord],
        channels: Iterable[Channel],
        messages: Iterable[tuple[int, int, int]],
        index: Mapping[int, int] | None,
    ) -> None:
        """Add a chunk that is in the file already to the summary.

        Args:
            place: Offset and length of its record.
            schemas: In it.
            channels: In it.
            messages: Channel, log time and offset in the chunk of each of its messages.
            index: Where its message indexes are, by channel; None if they are to be written.
        """
        for schema in schemas:
            self._schemas[schema.name] = schema
        names = {each.id: each.name for each in self._schemas.values()}
        for each in channels:
            key = each.topic, names.get(each.schema_id, ""), each.metadata.get(ORIGIN, "")
            self._channels[key] = each
            self._last_id = max(self._last_id, each.id)
        chunk = _Chunk()
        for channel, log_ns, offset in messages:
            chunk.note(channel, log_ns)
            chunk.index[channel][-1] = log_ns, offset
        chunk.size = place[1] - CHUNK_HEAD.size
        ends = sum(place)
        offsets = dict(index or {})
        length = sum(15 + 16 * len(chunk.index[each]) for each in offsets if each in chunk.index)
        self._note_chunk(chunk, *place, offsets, ends + length)
        self._last = chunk

    def adopt_metadata(self, place: int, length: int, name: str) -> None:
        """Add metadata that are in the file already to the summary."""
        self._metadata.append(MetadataIndex(place, length, name))

    def cut(self, size: int) -> None:
        """Cut the file off after its last whole chunk.

        Raises:
            OSError: It cannot be written.
        """
        os.ftruncate(self._file, size)
        self.size = size

    def index_last(self) -> None:
        """Write the message indexes of the chunk that was adopted last, at the end of the file.

        Raises:
            OSError: They cannot be written.
        """
        if not self._chunks:
            return
        offsets, indexes = self._message_indexes(self._last, self.size)
        found = self._chunks[-1]
        found.message_index_offsets = offsets
        found.message_index_length = sum(map(len, indexes))
        self._write(indexes)

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for the chunk to be written."""
        return self._chunk.size

    def add(self, record: Record) -> None:
        """Add a sample; ``add_message`` says what it raises."""
        message = encoded(record)
        self.add_message(
            record.key,
            message.schema,
            (message.head, message.payload),
            record.log_time_ns,
            message.publish_time_ns,
            message.sequence,
            {"zenoh_encoding": record.encoding, ORIGIN: record.origin},
            record,
        )

    def add_message(
        self,
        topic: str,
        schema: Schema,
        parts: Iterable[bytes],
        log_ns: int,
        publish_ns: int,
        sequence: int = 0,
        metadata: Mapping[str, str] | None = None,
        record: Record | None = None,
    ) -> None:
        """Add a message of any schema, and write the chunk if it is full.

        Args:
            topic: Of its channel.
            schema: Of its channel.
            parts: Its bytes; they are kept until the chunk is written.
            log_ns: Time of arrival, ns since 1970.
            publish_ns: Time of capture or publication.
            sequence: Its number, below 2^32.
            metadata: Of the channel, if this is its first message.
            record: The sample that it holds, which is lost if its chunk is.

        Raises:
            ChunkLost: As for ``flush``.
            TooManyKeys: The file has ``MAX_CHANNELS`` already.
        """
        channel = self._channel(topic, schema, metadata or {})
        chunk = self._chunk
        if channel.id not in chunk.index:  # each chunk can be read without the others
            if channel.schema_id not in chunk.schemas:
                chunk.schemas.add(channel.schema_id)
                chunk.append(record_bytes(self._schemas[schema.name]))
            chunk.append(record_bytes(channel))
        data = [each for each in parts if each]
        length = 22 + sum(map(len, data))
        chunk.note(channel.id, log_ns)
        chunk.append(
            MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channel.id, sequence, log_ns, publish_ns)
        )
        for each in data:
            chunk.append(each)
        if record is not None:
            chunk.records.append(record)
        if chunk.size >= self._chunk_bytes:
            self.flush()

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record, after the messages that wait.

        Raises:
            ChunkLost: As for ``flush``; nothing is written then.
            OSError: It cannot be written.
        """
        self.flush()
        data = record_bytes(Metadata(name, dict(values)))
        place = self.size
        self._write([data])
        self._metadata.append(MetadataIndex(place, len(data), name))

    def flush(self) -> None:
        """Write the chunk, if there are messages.

        Raises:
            ChunkLost: It cannot be written; the file is as before it, and can be written to.
        """
        chunk, self._chunk = self._chunk, _Chunk()
        if not chunk.index:
            return
        head = CHUNK_HEAD.pack(
            Opcode.CHUNK,
            CHUNK_HEAD.size - 9 + chunk.size,
            chunk.first_ns,
            chunk.last_ns,
            chunk.size,
            chunk.crc,
            0,
            chunk.size,
        )
        place, length = self.size, len(head) + chunk.size
        offsets, indexes = self._message_indexes(chunk, place + length)
        try:
            self._write([head, *chunk.buffers, *indexes])
        except OSError as error:
            raise ChunkLost(error, chunk.records) from error
        self._note_chunk(chunk, place, length, offsets, self.size)

    def _message_indexes(self, chunk: _Chunk, place: int) -> tuple[dict[int, int], list[bytes]]:
        """Return where the message indexes of a chunk are from a place on, and their bytes."""
        offsets, indexes = {}, []
        for channel, entries in chunk.index.items():
            indexes.append(record_bytes(MessageIndex(channel, entries)))
            offsets[channel] = place
            place += len(indexes[-1])
        return offsets, indexes

    def _note_chunk(
        self, chunk: _Chunk, place: int, length: int, offsets: dict[int, int], end: int
    ) -> None:
        """Note a chunk that is in the file, for the summary."""
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=place,
                compression="",
                compressed_size=chunk.size,
                message_end_time=chunk.last_ns,
                message_index_length=end - place - length,
                message_index_offsets=offsets,
                message_start_time=chunk.first_ns,
                uncompressed_size=chunk.size,
            )
        )
        for channel, entries in chunk.index.items():
            self._counts[channel] += len(entries)

    def sync_name(self) -> None:
        """Wait until the file's name is on the disk, without which its contents are lost.

        Raises:
            OSError: The disk failed.
        """
        sync_folder(self.partial.parent)
        self._is_named = True

    def sync(self) -> None:
        """Wait until what is written is on the disk, and free the page cache of it.

        Safe beside the methods that write, on another thread.

        Raises:
            OSError: The disk failed.
        """
        size = self.size
        os.fdatasync(self._file)
        if not self._is_named:
            self.sync_name()
        # The cache is of use to other programs, and nobody reads what was recorded so soon.
        os.posix_fadvise(self._file, self._synced, size - self._synced, os.POSIX_FADV_DONTNEED)
        self._synced = size

    def close(self, end: Mapping[str, str] | None = None) -> Path:
        """Complete the file, wait until it is on the disk, and give it its name.

        Raises:
            ChunkLost: As for ``finish``.
            OSError: So.
            RecordingError: As for ``publish``.
        """
        self.finish(end)
        return self.publish()

    def finish(self, end: Mapping[str, str] | None = None) -> None:
        """Write what waits, the metadata ``end``, index and summary.

        Raises:
            ChunkLost: As for ``flush``; the file can still be closed.
            OSError: It cannot be written: it stays ``.partial``, and is readable as far as it is.
        """
        self.flush()
        if end:
            self.add_metadata("zenoh_vision.end", end)
        self._write([record_bytes(DataEnd(0)), *self._summary(self.size + DATA_END_BYTES), MAGIC])

    def publish(self) -> Path:
        """Wait until the file, which is complete, is on the disk, and give it its name.

        Raises:
            OSError: The disk failed: it stays ``.partial``.
            RecordingError: Another file has got the name meanwhile.
        """
        os.fsync(self._file)
        self.abandon()
        if self.partial != self.path:
            rename_new(self.partial, self.path)
        return self.path

    def discard(self) -> None:
        """Close the file and delete it; does nothing if it is closed."""
        if self._file >= 0:
            self.abandon()
            self.partial.unlink(missing_ok=True)

    def abandon(self) -> None:
        """Close the file without a summary; does nothing if it is closed."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _channel(self, topic: str, schema: Schema, metadata: Mapping[str, str]) -> Channel:
        key = topic, schema.name, metadata.get(ORIGIN, "")
        known = self._channels.get(key)
        if known is not None:
            return known
        if len(self._channels) >= MAX_CHANNELS and schema.kind != ACCOUNT.kind:
            raise TooManyKeys(f"more than {MAX_CHANNELS} keys in one file: {topic} is too many")
        found = self._schemas.get(schema.name)
        if found is None:
            number = max((each.id for each in self._schemas.values()), default=0) + 1
            found = SchemaRecord(number, schema.data, schema.encoding, schema.name)
            self._schemas[schema.name] = found
        kind = {CHANNEL_KIND: schema.kind} if schema.kind else {}
        self._last_id += 1
        channel = Channel(
            self._last_id,
            topic,
            schema.message_encoding,
            {**kind, **metadata},
            found.id,
        )
        self._channels[key] = channel
        return channel

    def _summary(self, start: int) -> list[bytes]:
        """Return the summary, which begins at a place of the file, and the footer."""
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=max((each.message_end_time for each in self._chunks), default=0),
            message_start_time=min((each.message_start_time for each in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[int, list[McapRecord]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
            (Opcode.METADATA_INDEX, list(self._metadata)),
        ]
        data, offsets = b"", []
        for opcode, records in groups:
            if records:
                group = record_bytes(*records)
                offsets.append(SummaryOffset(opcode, start + len(data), len(group)))
                data += group
        offsets_start = start + len(data)
        data += record_bytes(*offsets)
        footer = FOOTER.pack(Opcode.FOOTER, 20, start, offsets_start)
        crc = zlib.crc32(footer, zlib.crc32(data))
        return [data, footer, struct.pack("<I", crc)]

    def _write(self, buffers: list[bytes]) -> None:
        """Write all bytes, or none: after an error the file is as long as before."""
        views = [memoryview(each) for each in buffers if each]
        total = sum(map(len, views))
        written, first = 0, 0
        try:
            while first < len(views):
                done = os.pwritev(
                    self._file, views[first : first + MOST_BUFFERS], self.size + written
                )
                written += done
                while first < len(views) and done >= len(views[first]):
                    done -= len(views[first])
                    first += 1
                if done:
                    views[first] = views[first][done:]
        except OSError:
            os.ftruncate(self._file, self.size)
            raise
        self.size += total


DATA_END_BYTES: Final = len(record_bytes(DataEnd(0)))
