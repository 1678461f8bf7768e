"""``zv bag cut``, ``merge``, ``filter``, ``convert`` and ``repair``: new recordings of others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zenoh_vision.transport.connection import Connection
from zv.bag.editing import opened, selected, write
from zv.bag.record import ChunkLost, Record
from zv.bag.recording import Recording
from zv.bag.repair import repair as complete
from zv.bag.report import report_of
from zv.tools.bag.options import (
    ConvertOptions,
    CutOptions,
    FilterOptions,
    MergeOptions,
    RepairOptions,
)
from zv.tools.bag.progress import progress_on
from zv.tools.shared.output import Output


def cut(options: CutOptions, _: Connection, output: Output) -> None:
    """Write the part of a recording between two times.

    Raises:
        ConfigurationError: The start is after the recording.
        RecordingError: A file cannot be read or made.
        ExpectationNotMet: The part is empty.
    """
    _write([options.file], options.output, "cut", output, start=options.start, end=options.end)


def merge(options: MergeOptions, _: Connection, output: Output) -> None:
    """Write several recordings into one, in the order of arrival.

    Raises:
        RecordingError: A file cannot be read or made.
        ExpectationNotMet: All are empty.
    """
    _write(options.files, options.output, "merge", output)


def filter_(options: FilterOptions, _: Connection, output: Output) -> None:
    """Write some keys of a recording.

    Raises:
        ConfigurationError: A key expression is none.
        RecordingError: A file cannot be read or made.
        ExpectationNotMet: Nothing is left.
    """
    files = [options.file]
    _write(files, options.output, "filter", output, keys=options.keys, exclude=options.exclude)


def convert(options: ConvertOptions, _: Connection, output: Output) -> None:
    """Write a recording for another program.

    Raises:
        RecordingError: A file cannot be read or made.
        ExpectationNotMet: Nothing of it can be converted.
    """
    _write([options.file], options.output, "convert", output, profile=options.profile)


def _write(
    files: Sequence[str],
    target: str,
    command: str,
    output: Output,
    *,
    start: float = 0.0,
    end: float | None = None,
    keys: Sequence[str] = (),
    exclude: Sequence[str] = (),
    profile: str = "",
) -> None:
    with ExitStack() as stack, progress_on(output) as progress:
        recordings = opened(files, stack)
        begin_ns = min((each.start_ns for each in recordings if each.chunks), default=0)
        length_s = (max(each.end_ns for each in recordings) - begin_ns) / 1e9
        if start and start > length_s:
            raise ConfigurationError(f"--start {start:g} s: the recording is {length_s:.1f} s long")
        records = selected(
            recordings,
            start_ns=begin_ns + round(start * 1e9) if start else None,
            end_ns=None if end is None else begin_ns + round(end * 1e9),
            keys=keys,
            exclude=exclude,
            progress=progress,
        )
        about = {**recordings[0].about, "made_by": f"zv bag {command}"}
        about["made_of"] = " ".join(Path(each).name for each in files)
        count = write_checked(records, Path(target), about, profile=profile)
        problems = [f"{each.path}: {words}" for each in recordings for words in each.problems]
    for words in problems[:5]:
        output.note(words)
    output.result({"file": target, "messages": count}, f"{target}: {count} messages")


def write_checked(
    records: Iterable[Record], target: Path, about: dict[str, str], *, profile: str = ""
) -> int:
    """Write records into a new file, which is deleted if it is empty; return its messages.

    They are counted as ``zv bag info`` counts them, without the state at the begin.

    Raises:
        SourceError: The disk is full or fails.
        ExpectationNotMet: There are no records.
    """
    try:
        count = write(records, target, about, profile=profile)
    except (OSError, ChunkLost) as error:
        raise SourceError(f"cannot write {target}: {error}") from None
    if not count:
        target.unlink()
        raise ExpectationNotMet(f"nothing is left for {target}: it was not written")
    with Recording(target) as recording:
        return report_of(recording).messages


def repair(options: RepairOptions, _: Connection, output: Output) -> None:
    """Complete a recording.

    Raises:
        RecordingError: It cannot be read or written, or needs ``-o``.
    """
    target = None if options.output is None else Path(options.output)
    with progress_on(output) as progress:
        done = complete(Path(options.file), target, progress)
    if done is None:
        output.result({"file": options.file, "repaired": False}, f"{options.file} is complete")
        return
    fields = {
        "file": str(done.path),
        "repaired": True,
        "messages": done.messages,
        "lost_bytes": done.lost_bytes,
        "in_place": done.in_place,
    }
    lost = f"; {done.lost_bytes} bytes were not readable" if done.lost_bytes else ""
    output.result(fields, f"{done.path}: {done.messages} messages{lost}")
