"""``zv bag export``: frames, a video, tracks or fields of a recording."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, PayloadError, SourceError
from zenoh_vision.keys import is_picture
from zenoh_vision.messages import Tracks
from zenoh_vision.transport.connection import Connection
from zv.bag.frames import the_key
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.bag.writer import PARTIAL, PRIVATE
from zv.tools.bag.options import ExportOptions
from zv.tools.bag.progress import progress_on
from zv.tools.shared.message_fields import NoSuchField, fields_of, flat, pick, text_of
from zv.tools.shared.output import Output
from zv.tools.shared.received import Received

COLUMNS = ("camera", "epoch", "seq", "stamp_ns", "width", "height", "encoding", "node", "revision")
PICTURES = ("image/", "application/octet-stream;vision.")
MESSAGES = ("application/msgpack",)

Records = Iterator[Record]
Exported = tuple[int, int]
"""How much was written, and how many messages could not be read."""


def run(options: ExportOptions, _: Connection, output: Output) -> None:
    """Write what the name of the output says.

    Raises:
        ConfigurationError: Options do not fit together.
        RecordingError: The recording cannot be read.
        SourceError: The output exists, or cannot be written.
        ExpectationNotMet: There is nothing to write, or it is not clear what.
    """
    target = Path(options.output)
    suffix = target.suffix.lower()
    if options.draw and suffix != ".mp4":
        raise ConfigurationError("--draw is for FILE.mp4")
    if options.field and suffix != ".csv":
        raise ConfigurationError("--field is for FILE.csv")
    exports: dict[str, Callable[..., Exported]] = {".mp4": _video, ".csv": _fields, ".txt": _mot}
    if suffix and suffix not in exports:
        raise ConfigurationError(
            f"-o {options.output}: allowed are FOLDER/, FILE.mp4, FILE.csv and FILE.txt"
        )
    if target.exists():
        raise SourceError(f"{target} exists already, and is not overwritten")
    with Recording(options.file) as recording, progress_on(output) as progress:
        export = exports.get(suffix, _frames)
        begin_ns = recording.start_ns + round(options.start * 1e9)
        end_ns = None if options.end is None else recording.start_ns + round(options.end * 1e9)

        def records_on(key: str) -> Records:
            total = recording.end_ns - recording.start_ns
            for record in recording.records(start_ns=begin_ns, end_ns=end_ns, keys=[key]):
                progress(record.log_time_ns - recording.start_ns, total)
                yield record

        try:
            count, unread = export(options, recording, records_on, target)
        except OSError as error:
            raise SourceError(f"cannot write {target}: {error.strerror or error}") from None
        problems = recording.problems[:5]
    for words in problems:
        output.note(f"{options.file}: {words}")
    if unread:
        output.note(f"{options.file}: {unread} messages could not be read, and are left out")
    fields = {"file": str(target), "exported": count, "left_out": unread}
    output.result(fields, f"{target}: {count} exported")


@contextmanager
def _new_file(target: Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Yield a file, by default of text, that gets its name when it is complete."""
    partial = target.with_name(target.name + PARTIAL)
    newline = None if "b" in mode else ""
    try:
        with os.fdopen(
            os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, PRIVATE), mode, newline=newline
        ) as file:
            yield file
        partial.rename(target)
    finally:
        partial.unlink(missing_ok=True)


def _frames(
    options: ExportOptions, recording: Recording, records_on: Callable[[str], Records], target: Path
) -> Exported:
    """Write each frame as it was recorded, read or not, and a CSV of their headers."""
    key = the_key(recording, options.key, PICTURES, "pictures")
    partial = target.with_name(target.name + PARTIAL)
    partial.mkdir(mode=0o700, parents=True)
    count = 0
    try:
        with (partial / "frames.csv").open("w", newline="") as file:
            table = csv.writer(file)
            table.writerow(("file", "key", "log_time_ns", "zenoh_time_ns", *COLUMNS))
            for record in records_on(key):
                if not is_picture(record.encoding) or record.deleted:
                    continue
                name = f"{count:06d}{_suffix(record.encoding)}"
                (partial / name).write_bytes(record.payload)
                count += 1
                stamp = "" if record.timestamp is None else record.timestamp.ns
                header = [record.header.get(each, "") for each in COLUMNS]
                table.writerow((name, record.key, record.log_time_ns, stamp, *header))
        _check(count, 0, key)
        partial.rename(target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return count, 0


def _suffix(encoding: str) -> str:
    form = encoding.removeprefix("image/").partition(";")[0]
    return {"jpeg": ".jpg"}.get(form, f".{form}") if encoding.startswith("image/") else ".raw"


def _video(
    options: ExportOptions, recording: Recording, records_on: Callable[[str], Records], target: Path
) -> Exported:
    """Write a video of the frames at their times of capture."""
    from zv.tools.bag.video import write_video

    key = the_key(recording, options.key, PICTURES, "pictures")
    with _new_file(target, "wb") as file:
        found = write_video(recording, records_on(key), key, file, draw_results=options.draw)
        return _check(*found, key)


def _mot(
    options: ExportOptions, recording: Recording, records_on: Callable[[str], Records], target: Path
) -> Exported:
    """Write confirmed tracks: frame, id, left, top, width, height, confidence, -1, -1, -1.

    Frames count from 1 at the first frame of the recording; another epoch goes on counting.
    """
    key = the_key(recording, options.key, ("application/msgpack;vision.Tracks.",), "tracks")
    count = unread = 0
    with _new_file(target) as file:
        table = csv.writer(file, lineterminator="\n")
        epoch, first, number, base = None, 0, 0, 0
        for record in records_on(key):
            try:
                tracks = Tracks.from_bytes(record.payload)
            except PayloadError:
                unread += 1
                continue
            if tracks.header.epoch != epoch:
                epoch, first, base = tracks.header.epoch, tracks.header.seq, number + 1
            number = base + tracks.header.seq - first
            for each in tracks.tracks:
                if each.state == "confirmed":
                    table.writerow((number, each.id, *each.box, 1, -1, -1, -1))
                    count += 1
        return _check(count, unread, key)


def _fields(
    options: ExportOptions, recording: Recording, records_on: Callable[[str], Records], target: Path
) -> Exported:
    """Write fields of messages, a line for each message; by default all of the first."""
    key = the_key(recording, options.key, MESSAGES, "messages")
    names = list(options.field)
    count = unread = 0
    failure = ""
    with _new_file(target) as file:
        table = csv.writer(file)
        for record in records_on(key):
            found = fields_of(
                Received(
                    record.key,
                    record.encoding,
                    record.attachment,
                    record.payload,
                    len(record.payload),
                    deleted=record.deleted,
                )
            )
            if "unreadable" in found:
                unread += 1
                continue
            wanted = names or list(flat(found))
            try:
                cells = [pick(found, each.split(".")) for each in wanted]
            except NoSuchField as error:
                has = ", ".join(error.args)
                failure = failure or f"{key} has not all of {', '.join(wanted)}; it has {has}"
                unread += 1
                continue
            if not count:
                names = wanted
                table.writerow(["log_time_ns", *names])
            table.writerow([record.log_time_ns, *map(_cell, cells)])
            count += 1
        if failure and not count:
            raise ExpectationNotMet(failure)
        return _check(count, unread, key)


def _cell(value: Any) -> str:
    return "" if value is None else text_of(value)


def _check(count: int, unread: int, key: str) -> Exported:
    if not count:
        why = f" ({unread} messages could not be read)" if unread else ""
        raise ExpectationNotMet(f"nothing on {key} to export{why}: nothing was written")
    return count, unread
