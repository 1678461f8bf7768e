"""Files that were made to do harm, and random damage: an error or a part, in bounded memory."""

from __future__ import annotations

import os
import random
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, DataEnd, Header, Metadata, Statistics

from tests.zv.bag.records import frame, recorded
from zenoh_vision.errors import VisionError
from zv.bag.recording import Recording
from zv.bag.report import report_of
from zv.bag.writer import MAGIC, Writer, record_bytes

MUTANTS = 200
SEED = 7
EXTREMES = tuple(
    value.to_bytes(8, "little") for value in (0, 2**64 - 1, 2**63, 2**32, 2**28, 10_000)
)
PEAK_BYTES = 30_000_000


@pytest.fixture
def whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    monkeypatch.setattr("zv.bag.recorder.files.FLUSH_S", 0.0)
    return recorded(tmp_path / "whole.mcap", 6, size=200)


def read(path: Path) -> int:
    """Read all that there is in a file, in every way; return the number of samples."""
    with Recording(path) as recording:
        count = sum(1 for each in recording.records() if each.header is not None)
        report_of(recording).to_map()
        recording.keys()
        return count


def without_crcs(data: bytes) -> bytes:
    """Return a file in which no CRC is set, so that damage is not found by it."""
    changed, place = bytearray(data), len(MAGIC)
    while place + 9 < len(changed):
        opcode, length = struct.unpack_from("<BQ", changed, place)
        at = {Opcode.CHUNK: 24, Opcode.FOOTER: 16}.get(opcode)
        if at is not None:
            changed[place + 9 + at : place + 13 + at] = bytes(4)
        place += 9 + length
    return bytes(changed)


def mutated(data: bytes, chance: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.choice((1, 2, 8))):
        at = chance.randrange(len(changed))
        match chance.randrange(4):
            case 0:
                changed[at] = chance.randrange(256)
            case 1:
                value = chance.choice(EXTREMES)[: chance.choice((2, 4, 8))]
                changed[at : at + len(value)] = value
            case 2:
                del changed[at : at + chance.randrange(1, 60)]
            case _:
                start = chance.randrange(len(changed))
                changed[at:at] = changed[start : start + 100]
    return bytes(changed)


def test_damage_anywhere_ends_in_an_error_or_a_part_and_takes_little_memory(
    tmp_path: Path, whole: bytes
) -> None:
    chance, bare, path = random.Random(SEED), without_crcs(whole), tmp_path / "x.mcap"
    outcomes = {"read": 0, "refused": 0}
    for number in range(MUTANTS):
        path.write_bytes(mutated(bare if number % 2 else whole, chance))
        is_measured = number % 10 == 1  # it takes ten times as long
        if is_measured:
            tracemalloc.start()
        try:
            read(path)
            outcomes["read"] += 1
        except VisionError:
            outcomes["refused"] += 1
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert peak < PEAK_BYTES
    assert outcomes["read"] > MUTANTS // 2


def chunk(compression: str, data: bytes, size: int) -> bytes:
    """Return a chunk that says that its contents have a size."""
    name = compression.encode()
    body = struct.pack("<QQQII", 1, 2, size, 0, len(name)) + name
    body += struct.pack("<Q", len(data)) + data
    return struct.pack("<BQ", Opcode.CHUNK, len(body)) + body


@pytest.mark.parametrize(
    ("compression", "pack"),
    [("zstd", zstandard.ZstdCompressor().compress), ("lz4", lz4.frame.compress)],
)
@pytest.mark.parametrize("size", [10, 2**40])
def test_a_chunk_that_unpacks_to_more_than_it_says_is_not_unpacked(
    tmp_path: Path, compression: str, pack: Callable[[bytes], bytes], size: int
) -> None:
    path = tmp_path / "x.mcap"
    bomb = chunk(compression, pack(bytes(200_000_000)), size)
    path.write_bytes(MAGIC + record_bytes(Header("", "")) + bomb)
    tracemalloc.start()
    try:
        assert read(path) == 0
        assert tracemalloc.get_traced_memory()[1] < PEAK_BYTES
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_chunks_that_other_programs_compressed_are_read(
    tmp_path: Path, whole: bytes, compression: str
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(whole)
    with Recording(path) as recording:
        contents = b"".join(bytes(recording._file.contents(each)) for each in recording.chunks)
    packed = {"zstd": zstandard.ZstdCompressor().compress, "lz4": lz4.frame.compress}
    data = chunk(compression, packed[compression](contents), len(contents))
    path.write_bytes(MAGIC + record_bytes(Header("", "")) + data + record_bytes(DataEnd(0)))
    assert read(path) == 13


def test_a_file_full_of_what_seems_to_be_chunks_is_not_read_again_and_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size, path = 1_000_000, tmp_path / "x.mcap"
    data = bytearray(MAGIC + b"\xee" * size)
    for place in range(100, size - 100, 64):
        rest = len(data) - place - 9
        head = struct.pack("<BQQQQII", Opcode.CHUNK, rest, 1, 2, rest - 40, 1, 0)
        data[place : place + len(head) + 8] = head + struct.pack("<Q", rest - 40)
    path.write_bytes(data)
    read_bytes, pread = [0], os.pread

    def counted(file: int, length: int, at: int) -> bytes:
        found = pread(file, length, at)
        read_bytes[0] += len(found)
        return found

    monkeypatch.setattr(os, "pread", counted)
    assert read(path) == 0
    assert read_bytes[0] < 10 * size  # to read each of the 15,000 would take 7 GB


def closed(*summary: bytes, data: bytes = b"") -> bytes:
    """Return a file with a summary that says what it likes, with the right CRC."""
    start = MAGIC + record_bytes(Header("", "")) + data + record_bytes(DataEnd(0))
    body = b"".join(summary)
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, len(start), 0)
    crc = zlib.crc32(footer, zlib.crc32(body))
    return start + body + footer + struct.pack("<I", crc) + MAGIC


def place_of(offset: int, length: int, first: int = 1, last: int = 2) -> bytes:
    return record_bytes(ChunkIndex(length, offset, "", 1, last, 0, {1: 5}, first, 1))


@pytest.mark.parametrize(
    "summary",
    [
        [place_of(2**63, 100)],
        [place_of(8, 2**63)],
        [place_of(8, 60), place_of(9, 60)],
        [place_of(8, 60, first=5, last=2)],
        [place_of(20, 0)] * 1000,
        [record_bytes(Statistics(2**32 - 1, 9, {1: 2**64 - 1}, 9, 2**64 - 1, 0, 2**64 - 1, 9, 9))],
        [record_bytes(Channel(1, "x" * 100_000, "protobuf", {"zenoh_vision": "sample.v1"}, 77))],
        [struct.pack("<BQ", Opcode.METADATA_INDEX, 20) + bytes(20)],
    ],
)
def test_an_index_that_lies_is_not_believed(tmp_path: Path, summary: list[bytes]) -> None:
    path = tmp_path / "x.mcap"
    about = record_bytes(Metadata("zenoh_vision", {"namespace": "vision"}))
    path.write_bytes(closed(*summary, data=about))
    with suppress(VisionError):
        assert read(path) == 0


def test_a_file_without_messages_is_read_and_said_to_prove_nothing(tmp_path: Path) -> None:
    path = Writer(tmp_path / "x.mcap", {"namespace": "vision"}).close()
    with Recording(path) as recording:
        assert list(recording.records()) == []
        report = report_of(recording)
    assert (report.verdict, report.start_ns) == ("completeness not proven", 0)


def test_times_at_the_end_of_all_numbers_are_read(tmp_path: Path) -> None:
    writer = Writer(tmp_path / "x.mcap", {"namespace": "vision"})
    writer.add(replace(frame(0), log_time_ns=2**64 - 1))
    with Recording(writer.close()) as recording:
        assert [each.log_time_ns for each in recording.records()] == [2**64 - 1]
        assert report_of(recording).end_ns == 2**64 - 1
