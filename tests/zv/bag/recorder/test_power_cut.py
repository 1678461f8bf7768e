"""After a power cut all that was synced is readable, and `zv bag repair` completes the file.

The disk is one that logs the calls of the recorder; what it may have kept of them is what POSIX
permits. So this does not show that a file system keeps to that, nor what a disk leaves which says
too early that it has written. Contents that another file left on the disk are not tried, either.
"""

from __future__ import annotations

import os
import re
from io import BytesIO
from pathlib import Path

import pytest
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex

from tests.support.power_cut import LoggedDisk, Name
from tests.support.waiting import wait_until
from tests.zv.bag.records import Camera, numbers, seqs_in
from zv.bag.record import RecordingError
from zv.bag.recorder.files import FLUSH_S
from zv.bag.recorder.plan import Plan
from zv.bag.recording import Recording
from zv.bag.repair import repair
from zv.bag.report import report_of
from zv.bag.writer import PARTIAL

STATES = 5
"""How many of the states after each cut are tried."""

SEED = 5


@pytest.mark.parametrize("plan", [{}, {"split_s": 2.0}, {"profile": "ros2"}])
def test_what_was_synced_is_readable_after_each_cut_and_a_repair_completes_it(
    tmp_path: Path, disk: LoggedDisk, monkeypatch: pytest.MonkeyPatch, plan: dict[str, object]
) -> None:
    camera = Camera(Plan(tmp_path / "run.mcap", **plan), monkeypatch)  # type: ignore[arg-type]
    camera.files.open()
    for number in range(10):
        count = number % 3 + 1
        if number == 4:
            disk.hold()  # so that two chunks and a file's end wait for it
        if number == 7:
            disk.release()
        camera.send(seconds=FLUSH_S, count=count)
        if number == 2:
            wait_until(lambda: not disk.going_on())
            camera.files._write_account()
    camera.files.stop()
    log = list(disk.log)
    monkeypatch.undo()
    monkeypatch.setattr(os, "fsync", lambda _: None)
    assert sum(isinstance(each, Name) for each in log) >= 2
    files = {each.file for each in log if isinstance(each, Name) and each.file is not None}
    chunks = {each: chunks_of(tmp_path / "whole.mcap", disk.content(each)) for each in files}
    for cut in range(len(log) + 1):
        promised = {
            seq
            for file, size in disk.synced(cut).items()
            for end, seqs in chunks[file]
            if end <= size
            for seq in seqs
        }
        for number, state in enumerate(disk.after_cut(cut, STATES, SEED)):
            left = tmp_path / f"left-{cut}-{number}"
            left.mkdir()
            for name, data in state.items():
                (left / name).write_bytes(data)
            found = set[int]()
            for path in list(left.iterdir()):
                found.update(repaired(path))
            assert promised <= found, f"cut after {cut} of {len(log)} calls, state {number}"
    assert promised == set(range(camera.sent))  # by the last cut, after all was closed
    names = {name for state in disk.after_cut(len(log), STATES, SEED) for name in state}
    assert names == {each.name for each in camera.files.paths}


def chunks_of(path: Path, content: bytes) -> list[tuple[int, list[int]]]:
    """Return where each chunk of a file ends, and the numbers of its frames."""
    path.write_bytes(content)
    with Recording(path) as recording:
        whole, ends = recording.chunks, []
        for each in whole:
            recording.chunks = [each]
            ends.append((each.offset + each.length, numbers(recording)))
    return ends


def repaired(path: Path) -> list[int]:
    """Repair what a cut has left, by a copy if need be; return the numbers of its frames."""
    try:
        with Recording(path) as recording:
            before, report = numbers(recording), report_of(recording)
    except RecordingError as error:
        if not re.search("is empty|not an MCAP file", str(error)):
            raise
        return []
    # A name without .partial says that the file is complete.
    is_complete = report.is_closed and not report.problems
    assert is_complete or path.name.endswith(PARTIAL)
    assert is_complete or report.ended.startswith("not closed: the recorder was killed")
    try:
        done = repair(path)
    except RecordingError as error:
        if "give -o FILE" not in str(error):
            raise
        done = repair(path, path.with_name(f"copy-{path.stem}"))
    whole = path if done is None else done.path
    assert not whole.name.endswith(PARTIAL)
    assert seqs_in([whole]) == before
    check_index(whole)
    return before


def check_index(path: Path) -> None:
    """Check the index with another reader: each message is where it says."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        messages = sum(1 for _ in reader.iter_messages()) if summary.chunk_indexes else 0
        indexed = 0
        for chunk in summary.chunk_indexes:
            file.seek(chunk.chunk_start_offset)
            whole = Chunk.read(ReadDataStream(BytesIO(file.read(chunk.chunk_length)[9:])))
            for channel, place in chunk.message_index_offsets.items():
                file.seek(place)
                assert file.read(1)[0] == Opcode.MESSAGE_INDEX
                index = MessageIndex.read(ReadDataStream(BytesIO(file.read(1 << 20)[8:])))
                assert index.channel_id == channel
                for _, offset in index.records:
                    assert whole.data[offset] == Opcode.MESSAGE
                    assert int.from_bytes(whole.data[offset + 9 : offset + 11], "little") == channel
                    indexed += 1
    assert indexed == messages
