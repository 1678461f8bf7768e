"""Completes a recording that was not closed: in its place, or as a copy of what is readable."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mcap.opcode import Opcode
from mcap.records import Channel, MessageIndex, Metadata, Schema

from zv.bag.chunks import (
    RECORD_HEAD,
    UNREADABLE,
    ChunkFile,
    ChunkPlace,
    message_of,
    records_in,
    stream_of,
)
from zv.bag.index import CUT_OFF
from zv.bag.record import RecordingError
from zv.bag.recorder.files import add_account
from zv.bag.recording import Recording
from zv.bag.report import report_of, rest_account
from zv.bag.ros2.profile import PROFILE
from zv.bag.schemas import CHANNEL_KIND
from zv.bag.schemas import Schema as OurSchema
from zv.bag.writer import PARTIAL, Writer, record_bytes

Progress = Callable[[int, int], None]
"""Called with the bytes that are done, and those of the whole file."""

KILLED: Final = "the recorder was killed; this account was made by `zv bag repair`"


@dataclass(frozen=True)
class Repaired:
    """What a repair did.

    Attributes:
        path: The complete file.
        messages: How many samples it has, as ``zv bag info`` counts them.
        lost_bytes: Bytes of the original that were not readable.
        in_place: No copy was made.
    """

    path: Path
    messages: int
    lost_bytes: int
    in_place: bool


def repair(
    path: Path, output: Path | None = None, progress: Progress = lambda *_: None
) -> Repaired | None:
    """Complete a recording; None if it is complete.

    Args:
        path: The file; one that ends in ``.partial`` gets its name without that.
        output: Write a copy instead; needed if the file is damaged, and not only cut off.
        progress: Called from time to time.

    Raises:
        RecordingError: It cannot be read or written, or ``output`` is needed.
    """
    with Recording(path) as recording:
        if recording.is_closed and not recording.problems and output is None:
            if not path.name.endswith(PARTIAL):
                return None
            return _repaired(_named(path), 0, in_place=True)
        minutes = list(recording.accounts())
        account = rest_account(recording, minutes, notes=[KILLED])
        if output is not None:
            # Those of a file for ROS are metadata, and not copied with the messages.
            kept = minutes if recording.profile == PROFILE else []
            return _copied(recording, output, [*kept, account], progress)
        problems = [each for each in recording.problems if not each.startswith(CUT_OFF)]
        if problems or recording.is_closed:
            raise _damaged(path, problems[0] if problems else "")
        chunks, metadata = list(recording.chunks), recording.metadata_places
        readable, profile, size = recording.readable_bytes, recording.profile, recording.size
    writer = _resumed(path)
    if writer.size != size:
        writer.abandon()
        raise RecordingError(f"{path} was written to while it was read; repair it again")
    end = chunks[-1].offset + chunks[-1].length if chunks else readable
    file = ChunkFile(path)
    try:
        _adopt(writer, file, chunks, progress)
        for at in metadata:
            length = RECORD_HEAD.size + file.head(at)[1]
            writer.adopt_metadata(at, length, file.record(at, Metadata.read).name)
            end = max(end, at + length)
        writer.cut(end)
        writer.index_last()
        if account["keys"]:
            add_account(writer, account, profile)
        closed = writer.close({"how": "repaired: the recorder was killed"})
    except (OSError, *UNREADABLE) as error:
        raise RecordingError(f"cannot repair {path}: {error}") from None
    finally:
        file.close()
        writer.abandon()
    return _repaired(closed, size - end, in_place=True)


def _repaired(path: Path, lost_bytes: int, *, in_place: bool) -> Repaired:
    with Recording(path) as recording:
        return Repaired(path, report_of(recording).messages, lost_bytes, in_place)


def _adopt(
    writer: Writer, file: ChunkFile, chunks: Sequence[ChunkPlace], progress: Progress
) -> None:
    """Add the chunks of a file to its summary; the index of the last one is yet to be written.

    Raises:
        RecordingError: An index after a chunk is damaged.
    """
    for chunk in chunks:
        contents = _contents(file, chunk)
        index = None
        if chunk is not chunks[-1]:
            index = _index_after(file, chunk, contents[2])
            if index is None:
                end = chunk.offset + chunk.length
                raise _damaged(writer.partial, f"the index at {end} is not whole")
        writer.adopt((chunk.offset, chunk.length), *contents, index)
        progress(chunk.offset, file.size)


def _contents(file: ChunkFile, chunk: ChunkPlace) -> tuple[list[Schema], list[Channel], list[Any]]:
    """Return schemas, channels, and (channel, log time, offset) of the messages of a chunk."""
    schemas, channels, messages = [], [], []
    contents = file.contents(chunk)
    place = 0
    for opcode, record in records_in(contents):
        if opcode == Opcode.SCHEMA:
            schemas.append(Schema.read(stream_of(record)))
        elif opcode == Opcode.CHANNEL:
            channels.append(Channel.read(stream_of(record)))
        elif opcode == Opcode.MESSAGE:
            message = message_of(record)
            messages.append((message.channel, message.log_ns, place))
        place += RECORD_HEAD.size + len(record)
    return schemas, channels, messages


def _index_after(
    file: ChunkFile, chunk: ChunkPlace, messages: Iterable[tuple[int, int, int]]
) -> dict[int, int] | None:
    """Return where the message indexes of a chunk are, by channel; None if they are not as written.

    They have no CRC, so after a power cut they may be torn.
    """
    entries: dict[int, list[tuple[int, int]]] = {}
    for channel, log_ns, offset in messages:
        entries.setdefault(channel, []).append((log_ns, offset))
    found: dict[int, int] = {}
    place = chunk.offset + chunk.length
    for channel, each in entries.items():
        data = record_bytes(MessageIndex(channel, each))
        if file.read(place, len(data)) != data:
            return None
        found[channel] = place
        place += len(data)
    return found


def _resumed(path: Path) -> Writer:
    return Writer.resumed(path, path.with_name(path.name.removesuffix(PARTIAL)))


def _named(path: Path) -> Path:
    """Give a complete file its name: power was cut, or the recorder killed, just before that."""
    writer = _resumed(path)
    try:
        return writer.publish()
    except OSError as error:
        raise RecordingError(f"cannot rename {path}: {error.strerror}") from None
    finally:
        writer.abandon()


def _damaged(path: Path, why: str) -> RecordingError:
    return RecordingError(
        f"{path} is damaged, and not only cut off ({why}): "
        "give -o FILE, into which what is readable is copied"
    )


def _copied(
    recording: Recording, output: Path, accounts: Sequence[dict[str, Any]], progress: Progress
) -> Repaired:
    about = {**recording.about, "repaired_from": str(Path(recording.path).name)}
    writer = Writer(output, about, profile=recording.profile)
    try:
        for count, (channel, schema, message) in enumerate(recording.messages()):
            kind = channel.metadata.get(CHANNEL_KIND, "")
            writer.add_message(
                channel.topic,
                OurSchema(
                    schema.name, kind, channel.message_encoding, schema.encoding, schema.data
                ),
                (bytes(message.data),),
                message.log_ns,
                message.publish_ns,
                message.sequence,
                channel.metadata,
            )
            if count % 1000 == 0:
                progress(writer.size, recording.size)
        for account in accounts:
            if account["keys"]:
                add_account(writer, account, recording.profile)
        path = writer.close({"how": "repaired"})
    except BaseException:
        writer.discard()
        raise
    lost = recording.size - sum(each.length for each in recording.chunks)
    return _repaired(path, max(0, lost), in_place=False)
