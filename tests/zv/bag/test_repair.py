"""A recording that was cut off becomes a complete one, wherever it was cut."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from tests.zv.bag.records import frame, recorded
from zv.bag.record import RecordingError
from zv.bag.recording import Recording
from zv.bag.repair import repair
from zv.bag.report import report_of
from zv.bag.writer import Writer


@pytest.fixture
def whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """A closed recording with many chunks and two accounts, of 20 frames and messages."""
    monkeypatch.setattr("zv.bag.recorder.files.FLUSH_S", 0.0)
    return recorded(tmp_path / "whole.mcap", 20, account_at=10)


def test_a_file_cut_at_200_places_is_completed_with_all_that_it_had(
    tmp_path: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: None)  # 400 of them take a disk 20 s
    path = tmp_path / "run.mcap"
    partial = tmp_path / "run.mcap.partial"
    for cut in random.Random(2).sample(range(100, len(whole) - 1), 200):
        partial.write_bytes(whole[:cut])
        with Recording(partial) as recording:
            before = list(recording.records())
        done = repair(partial)
        assert done is not None
        assert done.path == path
        assert done.in_place
        assert not partial.exists()
        with Recording(path) as recording:
            assert recording.is_closed
            assert not recording.problems
            assert list(recording.records()) == before, f"cut at {cut}"
            report = report_of(recording)
            assert done.messages == report.messages
            assert report.missed == 0
            assert [each for each in report.keys if each.epochs and not each.is_complete] == []
        with path.open("rb") as file:  # an independent reader, by index, with all CRCs
            found = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
        assert found >= len(before)
        path.unlink()


def test_a_closed_file_needs_no_repair(tmp_path: Path, whole: bytes) -> None:
    assert repair(tmp_path / "whole.mcap") is None
    assert (tmp_path / "whole.mcap").read_bytes() == whole


def test_a_complete_file_that_has_not_got_its_name_gets_it(tmp_path: Path, whole: bytes) -> None:
    partial = tmp_path / "run.mcap.partial"
    partial.write_bytes(whole)
    done = repair(partial)
    assert done is not None
    assert (done.path, done.in_place, done.lost_bytes) == (tmp_path / "run.mcap", True, 0)
    assert done.messages == 2 * 20  # without the accounts
    assert done.path.read_bytes() == whole
    assert not partial.exists()


def test_zeros_in_place_of_the_last_chunks_are_cut_off(tmp_path: Path, whole: bytes) -> None:
    partial = tmp_path / "run.mcap.partial"
    with Recording(tmp_path / "whole.mcap") as recording:
        chunks = list(recording.chunks)
        everything = list(recording.records())
    head = chunks[-2].offset + 57  # of a chunk whose contents have not reached the disk
    partial.write_bytes(whole[:head] + bytes(chunks[-1].offset + chunks[-1].length - head))
    done = repair(partial)
    assert done is not None
    assert done.in_place
    with Recording(done.path) as recording:
        left = list(recording.records())
    assert left == [each for each in everything if each.log_time_ns < chunks[-2].first_ns]
    assert left


def test_an_index_that_is_torn_is_not_believed(tmp_path: Path, whole: bytes) -> None:
    partial = tmp_path / "run.mcap.partial"
    with Recording(tmp_path / "whole.mcap") as recording:
        chunk = recording.chunks[4]
        everything = list(recording.records())
    torn = bytearray(whole[:-30])
    entry = chunk.offset + chunk.length + 15  # after opcode, length, channel and size
    torn[entry : entry + 16] = bytes(16)
    partial.write_bytes(torn)
    with pytest.raises(RecordingError, match="give -o FILE"):
        repair(partial)
    assert partial.read_bytes() == torn
    done = repair(partial, tmp_path / "copy.mcap")
    assert done is not None
    with Recording(done.path) as recording:
        assert list(recording.records()) == everything


def test_a_damaged_file_is_copied_without_the_damaged_part(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "damaged.mcap"
    with Recording(tmp_path / "whole.mcap") as recording:
        chunk = recording.chunks[8]
        everything = list(recording.records())
    broken = bytearray(whole)
    broken[chunk.offset : chunk.offset + 30] = b"\xaa" * 30
    path.write_bytes(broken[:-30])
    with pytest.raises(RecordingError, match="give -o FILE"):
        repair(path)
    assert path.read_bytes() == broken[:-30]
    done = repair(path, tmp_path / "readable.mcap")
    assert done is not None
    assert not done.in_place
    with Recording(done.path) as recording:
        left = list(recording.records())
        report = report_of(recording)
    lost = [each for each in everything if each not in left]
    assert lost
    assert all(chunk.first_ns <= each.log_time_ns <= chunk.last_ns for each in lost)
    assert not report.is_complete


def test_an_existing_file_is_not_overwritten(tmp_path: Path, whole: bytes) -> None:
    partial = tmp_path / "whole.mcap.partial"
    partial.write_bytes(whole[:-30])
    with pytest.raises(RecordingError, match="exists already"):
        repair(partial)
    assert (tmp_path / "whole.mcap").read_bytes() == whole


def test_a_file_that_is_being_written_is_not_repaired(tmp_path: Path) -> None:
    writer = Writer(tmp_path / "run.mcap")
    writer.add(frame(0))
    writer.flush()
    before = writer.partial.read_bytes()
    with Recording(writer.partial) as recording:
        assert report_of(recording).ended == "not closed: it is being written"
    with pytest.raises(RecordingError, match="is being written"):
        repair(writer.partial)
    assert writer.partial.read_bytes() == before
    writer.add(frame(1))
    assert writer.close() == tmp_path / "run.mcap"
    with Recording(tmp_path / "run.mcap") as recording:
        assert [each.number("seq") for each in recording.records()] == [0, 1]


def test_a_file_that_nobody_writes_is_said_to_be_killed_at_once(
    tmp_path: Path, whole: bytes
) -> None:
    partial = tmp_path / "run.mcap.partial"
    partial.write_bytes(whole[:-30])
    with Recording(partial) as recording:
        assert report_of(recording).ended.startswith("not closed: the recorder was killed")


def test_what_is_written_while_a_repair_reads_is_not_cut_off(
    tmp_path: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    partial = tmp_path / "run.mcap.partial"
    partial.write_bytes(whole[: len(whole) // 2])

    def written_meanwhile(*_: object, **__: object) -> dict[str, object]:
        partial.write_bytes(whole[:-30])
        return {"keys": {}}

    monkeypatch.setattr("zv.bag.repair.rest_account", written_meanwhile)
    with pytest.raises(RecordingError, match="written to while it was read"):
        repair(partial)
    assert partial.read_bytes() == whole[:-30]
