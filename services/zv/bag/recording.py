"""``Recording``: reads a recording, whole, cut or damaged, in the order of arrival."""

from __future__ import annotations

import heapq
import os
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import chain, count
from typing import Any, Final, Self

import zenoh
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata
from mcap.records import Schema as SchemaRecord

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.transport.zenoh_config import zenoh_error_text
from zv.bag.account import checked_account
from zv.bag.chunks import (
    UNREADABLE,
    ChunkFile,
    ChunkPlace,
    Message,
    message_of,
    records_in,
    stream_of,
)
from zv.bag.index import index_of
from zv.bag.layout import decoded
from zv.bag.protobuf import WireError
from zv.bag.record import Record, RecordingError
from zv.bag.schemas import ACCOUNT, CHANNEL_KIND, SAMPLES
from zv.bag.writer import ABOUT, ORIGIN

MAX_WAITING_BYTES: Final = 256 << 20
"""Limit of the messages that are kept to bring chunks into order whose times overlap."""

MAX_KEYS: Final = 10_000
"""Most keys of which is remembered whether they match."""

MAX_PROBLEMS: Final = 100
MAX_METADATA: Final = 10_000
KNOWN_KINDS: Final = ("sample.v1", "derived.v1", "account.v1")


class Recording:
    """One file; opening it reads its index, or finds its chunks if it has none.

    Attributes:
        is_closed: It was closed; if not, the recorder was killed, or still writes it.
        problems: What is wrong with the file, found so far; reading goes on after it.
        about: What the recorder wrote about the file at its begin, and ``end`` at its end.

    Raises:
        RecordingError: It cannot be opened, or is no recording.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        self._file = ChunkFile(path)
        try:
            index = index_of(self._file)
        except OSError as error:
            self._file.close()
            raise RecordingError(f"cannot read {path}: {error.strerror}") from None
        self.is_closed = index.closed
        self.profile, self.library = index.profile, index.library
        self.problems = index.problems
        self.readable_bytes = index.end
        self.size = self._file.size
        self.chunks: Sequence[ChunkPlace] = index.chunks
        self.statistics = index.statistics
        self._schemas, self._channels = index.schemas, index.channels
        self.metadata_places = index.metadata_places
        self._foreign = bool(index.loose) or bool(
            self._channels
            and not any(CHANNEL_KIND in each.metadata for each in self._channels.values())
        )
        self.about = self._metadata(ABOUT)
        self.end = self._metadata("zenoh_vision.end")
        if self._foreign and not self.about:
            self.close()
            raise RecordingError(
                f"{path} is an MCAP file of another program ({self.library or 'unknown'}); "
                "`zv bag import` converts recordings of ROS"
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def is_being_written(self) -> bool:
        """Return whether a recorder still has it open."""
        return self._file.is_locked()

    @property
    def start_ns(self) -> int:
        """Time of arrival of the first message, ns since 1970; 0 without messages."""
        return min((each.first_ns for each in self.chunks), default=0)

    @property
    def end_ns(self) -> int:
        """Time of arrival of the last message, ns since 1970; 0 without messages."""
        return max((each.last_ns for each in self.chunks), default=0)

    def channels(self) -> list[Channel]:
        """Return the channels that are known; without an index, those of what was read."""
        return list(self._channels.values())

    def counts(self) -> dict[str, int]:
        """Return the numbers of samples by key, as the index says, without those asked for."""
        counts = {} if self.statistics is None else self.statistics.channel_message_counts
        found: dict[str, int] = {}
        for channel in self._channels.values():
            if self.profile == "ros2":
                key = channel.topic.removeprefix("/")
                found[key] = found.get(key, 0) + counts.get(channel.id, 0)
                continue
            is_sample = channel.metadata.get(CHANNEL_KIND) == "sample.v1"
            if is_sample and channel.metadata.get(ORIGIN) != "query":
                found[channel.topic] = found.get(channel.topic, 0) + counts.get(channel.id, 0)
        return found

    def require_samples(self) -> None:
        """Refuse a file of another profile, which has no samples.

        Raises:
            RecordingError: It is for ROS 2.
        """
        if self.profile == "ros2":
            raise RecordingError(
                f"{self.path} is for ROS 2, without what zv plays and verifies; take the recording "
                "that it was made of, or have `zv bag import` make one of it"
            )

    def keys(self) -> list[str]:
        """Return the keys of the samples; reads the whole file if it has no index.

        Raises:
            RecordingError: It has none, since it is for ROS 2.
        """
        self.require_samples()
        if not self.is_closed:
            for _ in self.messages():
                pass  # each chunk says its channels
        kinds = (
            each.topic
            for each in self._channels.values()
            if each.metadata.get(CHANNEL_KIND) == "sample.v1"
        )
        return sorted(set(kinds))

    def keys_in_words(self) -> str:
        """Return the keys of the data, or, if there are none, those of the system."""
        found = self.keys()
        return ", ".join([key for key in found if not key.startswith("@")] or found) or "none"

    def records(
        self,
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        keys: Sequence[str] = (),
    ) -> Iterator[Record]:
        """Yield the samples in the order of their arrival.

        Args:
            start_ns: Time of arrival of the first, ns since 1970.
            end_ns: Time of arrival before which the last one is.
            keys: Key expressions of those to yield; by default all.

        Raises:
            ConfigurationError: One of ``keys`` is no key expression.
            RecordingError: The disk fails, or the file was written by a newer version.
        """
        matches = matcher(keys)
        return self.records_of(lambda channel: matches(channel.topic), start_ns, end_ns)

    def records_of(
        self,
        matches: Callable[[Channel], bool],
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[Record]:
        """Yield the samples of some channels, as ``records`` does."""
        for channel, schema, message in self.messages(
            start_ns=start_ns, end_ns=end_ns, kind="sample.v1", matches=matches
        ):
            found = SAMPLES.get(schema.name)
            if found is None:
                self.note(f"{channel.topic} has the unknown schema {schema.name}")
                continue
            try:
                yield decoded(channel.topic, found, message.data, message.log_ns)
            except WireError as error:
                self.note(f"a message on {channel.topic} is unreadable: {error}")

    def accounts(self) -> Iterator[dict[str, Any]]:
        """Yield what the recorder wrote, once a minute and at the end, about what it missed."""
        messages = self.messages(kind=ACCOUNT.kind)
        texts: list[str | bytes] = [
            each["json"] for each in self._metadata_named(ACCOUNT.name) if "json" in each
        ]
        for text in chain(texts, (bytes(message.data) for _, _, message in messages)):
            account = checked_account(text)
            if account is None:
                self.note("an account of losses is unreadable")
            else:
                yield account

    def messages(
        self,
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        kind: str | None = None,
        matches: Callable[[Channel], bool] = lambda _: True,
    ) -> Iterator[tuple[Channel, SchemaRecord, Message]]:
        """Yield the messages of one kind of channel, or of all, in the order of their log times.

        Raises:
            RecordingError: The disk fails, or the file was written by a newer version.
        """
        wanted = _Wanted(start_ns, end_ns, kind, matches)
        waiting: list[tuple[int, int, int, tuple[Channel, SchemaRecord, Message]]] = []
        number, size = count(), 0
        chunks = sorted(self.chunks, key=lambda each: (each.first_ns, each.offset))
        for chunk in chunks:
            while waiting and (waiting[0][0] < chunk.first_ns or size > MAX_WAITING_BYTES):
                _, _, share, entry = heapq.heappop(waiting)
                size -= share
                yield entry
            if not self._may_have(chunk, wanted):
                continue
            entries = list(self._wanted_in(chunk, wanted))
            share = chunk.length // max(1, len(entries))  # each keeps the whole chunk in memory
            for entry in entries:
                heapq.heappush(waiting, (entry[2].log_ns, next(number), share, entry))
                size += share
        while waiting:
            yield heapq.heappop(waiting)[3]

    def note(self, problem: str) -> None:
        """Add a problem to those of the file, once, and no more than ``MAX_PROBLEMS``."""
        if problem not in self.problems and len(self.problems) < MAX_PROBLEMS:
            self.problems.append(problem)

    def _may_have(self, chunk: ChunkPlace, wanted: _Wanted) -> bool:
        if not wanted.times(chunk.first_ns, chunk.last_ns):
            return False
        if chunk.channels is None:
            return True
        found = (self._channels.get(each) for each in chunk.channels)
        return any(each is None or wanted.channel(each) for each in found)

    def _wanted_in(
        self, chunk: ChunkPlace, wanted: _Wanted
    ) -> Iterator[tuple[Channel, SchemaRecord, Message]]:
        try:
            contents = self._file.contents(chunk)
        except OSError as error:
            raise RecordingError(f"cannot read {self.path}: {error.strerror}") from None
        except UNREADABLE as error:
            self.note(str(error) or f"the chunk at {chunk.offset} is damaged")
            return
        try:
            for opcode, record in records_in(contents):
                if opcode == Opcode.SCHEMA:
                    schema = SchemaRecord.read(stream_of(record))
                    self._schemas[schema.id] = schema
                elif opcode == Opcode.CHANNEL:
                    channel = Channel.read(stream_of(record))
                    self._channels[channel.id] = channel
                elif opcode == Opcode.MESSAGE:
                    message = message_of(record)
                    entry = self._entry(message, wanted)
                    if entry is not None:
                        yield entry
        except UNREADABLE as error:
            self.note(f"the chunk at {chunk.offset} has an unreadable record: {error}")

    def _entry(
        self, message: Message, wanted: _Wanted
    ) -> tuple[Channel, SchemaRecord, Message] | None:
        channel = self._channels.get(message.channel)
        schema = None if channel is None else self._schemas.get(channel.schema_id)
        if channel is None or schema is None:
            self.note("a message belongs to an unknown channel")
            return None
        kind = channel.metadata.get(CHANNEL_KIND, "")
        if kind and kind not in KNOWN_KINDS:
            raise RecordingError(
                f"{self.path} was written by a newer version: {channel.topic} has messages "
                f"{kind!r}, known are {', '.join(KNOWN_KINDS)}"
            )
        if wanted.channel(channel) and wanted.times(message.log_ns, message.log_ns):
            return channel, schema, message
        return None

    def _metadata(self, name: str) -> dict[str, str]:
        found: dict[str, str] = {}
        for each in self._metadata_named(name):
            found.update(each)
        return found

    def _metadata_named(self, name: str) -> list[dict[str, str]]:
        found = []
        for place in self.metadata_places[:MAX_METADATA]:
            try:
                metadata: Metadata = self._file.record(place, Metadata.read)
            except OSError as error:
                raise RecordingError(f"cannot read {self.path}: {error.strerror}") from None
            except UNREADABLE as error:
                self.note(f"metadata at {place} are unreadable: {error}")
                continue
            if metadata.name == name:
                found.append(metadata.metadata)
        return found


class _Wanted:
    """Which messages are asked for."""

    def __init__(
        self,
        start_ns: int | None,
        end_ns: int | None,
        kind: str | None,
        matches: Callable[[Channel], bool],
    ) -> None:
        self._start_ns = 0 if start_ns is None else start_ns
        self._end_ns = 2**64 if end_ns is None else end_ns
        self._kind = kind
        self._matches = matches

    def times(self, first_ns: int, last_ns: int) -> bool:
        return last_ns >= self._start_ns and first_ns < self._end_ns

    def channel(self, channel: Channel) -> bool:
        if self._kind is not None and channel.metadata.get(CHANNEL_KIND) != self._kind:
            # A kind of a newer version passes, and is then refused by its name.
            return channel.metadata.get(CHANNEL_KIND, self._kind) not in (self._kind, *KNOWN_KINDS)
        return self._matches(channel)


def matcher(keys: Sequence[str], *, without_any: bool = True) -> Callable[[str], bool]:
    """Return what tells whether a key matches one of some key expressions.

    Without any expressions it says ``without_any`` of each key.

    Raises:
        ConfigurationError: One of them is no key expression.
    """
    try:
        expressions = [zenoh.KeyExpr.autocanonize(each.removeprefix("/")) for each in keys]
    except zenoh.ZError as error:
        raise ConfigurationError(
            f"{list(keys)!r}: not a key expression ({zenoh_error_text(error)}); allowed are "
            "chunks between single slashes, * for one chunk, ** for any number"
        ) from None

    @lru_cache(MAX_KEYS)  # anyone can publish on any number of them
    def matches(key: str) -> bool:
        return _matches(expressions, key) if expressions else without_any

    return matches


def _matches(expressions: Sequence[zenoh.KeyExpr], key: str) -> bool:
    try:
        return any(each.intersects(zenoh.KeyExpr(key)) for each in expressions)
    except zenoh.ZError:
        return False  # the topic of another program's channel
