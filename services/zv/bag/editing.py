"""Makes new recordings of others: a part of one, several together, or a file for ROS 2."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from zv.bag.record import Record
from zv.bag.recorder.files import add_account, add_record
from zv.bag.recorder.ledger import Ledger
from zv.bag.recording import Recording, matcher
from zv.bag.writer import ORIGIN, Writer

Progress = Callable[[int, int], None]
"""Called with what is done, and all that is to do."""

MINUTE_NS = 60 * 10**9


def selected(
    recordings: Sequence[Recording],
    *,
    start_ns: int | None = None,
    end_ns: int | None = None,
    keys: Sequence[str] = (),
    exclude: Sequence[str] = (),
    progress: Progress = lambda *_: None,
) -> Iterator[Record]:
    """Yield records of recordings in the order of their arrival.

    What the recorder had asked for before ``start_ns`` is yielded first, as of that time, so that
    the part can be understood alone.
    """
    is_excluded = matcher(exclude, without_any=False)
    begin_ns = min((each.start_ns for each in recordings if each.chunks), default=0)
    finish_ns = max((each.end_ns for each in recordings), default=0)
    if start_ns is not None and start_ns > begin_ns:
        yield from _state(recordings, start_ns, matcher(keys), is_excluded)
    streams = [each.records(start_ns=start_ns, end_ns=end_ns, keys=keys) for each in recordings]
    for number, record in enumerate(heapq.merge(*streams, key=lambda each: each.log_time_ns)):
        if number % 500 == 0:
            progress(record.log_time_ns - begin_ns, finish_ns - begin_ns)
        if not is_excluded(record.key):
            yield record


def _state(
    recordings: Sequence[Recording],
    start_ns: int,
    matches: Callable[[str], bool],
    is_excluded: Callable[[str], bool],
) -> Iterator[Record]:
    newest: dict[str, Record] = {}
    for recording in recordings:
        for record in recording.records_of(
            lambda channel: channel.metadata.get(ORIGIN) == "query", end_ns=start_ns
        ):
            newest[record.key] = record
        for record in recording.records_of(
            lambda channel: channel.topic in newest and channel.metadata.get(ORIGIN) != "query",
            end_ns=start_ns,
        ):
            if not record.deleted:
                newest[record.key] = record
    for key, record in newest.items():
        if matches(key) and not is_excluded(key):
            yield replace(record, log_time_ns=start_ns, origin="query")


def write(
    records: Iterable[Record], output: Path, about: Mapping[str, str], *, profile: str = ""
) -> int:
    """Write records into a new file, with accounts of its own; return how many.

    The records are in the order of their arrival. The file appears when it is complete. The profile
    ``ros2`` leaves out what ROS has no message for.

    Raises:
        RecordingError: The file exists, or cannot be made.
        ChunkLost: It cannot be written.
        OSError: So.
    """
    writer = Writer(output, about, profile=profile)
    accounts = _Accounts(writer, profile)
    count = 0
    try:
        for record in records:
            if add_record(writer, record, profile):
                count += 1
                accounts.take(record)
        accounts.write()
        writer.close({"how": "closed"})
    except BaseException:
        writer.discard()
        raise
    return count


class _Accounts:
    """Accounts by the minute of what is written, by the numbers of the frames."""

    def __init__(self, writer: Writer, profile: str) -> None:
        self._writer, self._profile = writer, profile
        self._ledger = Ledger()
        self._begin_ns = self._last_ns = 0

    def take(self, record: Record) -> None:
        if not self._begin_ns:
            self._begin_ns = record.log_time_ns
        if record.log_time_ns - self._begin_ns >= MINUTE_NS:
            self.write()
            self._begin_ns = record.log_time_ns
        self._last_ns = max(self._last_ns, record.log_time_ns)
        if record.origin == "stream":
            self._ledger.take(record)

    def write(self) -> None:
        account = self._ledger.account(self._begin_ns, self._last_ns)
        add_account(self._writer, account, self._profile)


def opened(paths: Iterable[str | Path], stack: ExitStack) -> list[Recording]:
    """Return recordings, which a stack closes.

    Raises:
        RecordingError: One of them cannot be opened, or is for ROS 2.
    """
    found = [stack.enter_context(Recording(path)) for path in paths]
    for each in found:
        each.require_samples()
    return found
