"""What is written into a recording is read from it, whole, cut or damaged."""

from __future__ import annotations

import importlib
import random
import stat
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from tests.zv.bag.records import START_NS, frame, header, message, written
from zenoh_vision.errors import ConfigurationError
from zv.bag.record import Record, RecordingError, ZenohTime
from zv.bag.recording import MAX_KEYS, Recording, matcher
from zv.bag.schemas import Schema
from zv.bag.writer import Writer


def all_kinds() -> list[Record]:
    at = START_NS
    odd = [
        Record("a/b", b"", "", None, None, at, priority=7, drops=True, express=True),
        Record("a/b", b"\0\1", "text/plain", b"", ZenohTime(2**64 - 1, "ff"), at + 1),
        Record("a/b", b"", "text/plain", b"x" * 10_000, None, at + 2, deleted=True),
        Record("@vision/node/tracker", b"\x80", "application/msgpack", None, None, at + 3),
        replace(message(0, "camera_info"), origin="query", log_time_ns=at + 4),
        replace(
            frame(0),
            key="vision/front/image",
            payload=bytes(range(24)),
            encoding="application/octet-stream;vision.Image.v1",
            log_time_ns=at + 5,
        ),
        replace(frame(1), attachment=b"\xc1 no msgpack", log_time_ns=at + 6),
    ]
    return odd + [each for seq in range(1, 40) for each in (frame(seq), message(seq))]


def test_every_byte_of_a_sample_and_its_stamps_are_read_back(tmp_path: Path) -> None:
    records = all_kinds()
    with Recording(written(tmp_path / "run.mcap", records)) as recording:
        assert list(recording.records()) == records
        assert recording.is_closed
        assert not recording.problems
        assert recording.about == {"namespace": "vision"}


def test_times_and_keys_select_records(tmp_path: Path) -> None:
    records = all_kinds()
    with Recording(written(tmp_path / "run.mcap", records)) as recording:
        middle = frame(20).log_time_ns
        chosen = list(recording.records(start_ns=middle, keys=["vision/*/centroid"]))
        assert chosen == [message(seq) for seq in range(20, 40)]
        before = list(recording.records(end_ns=middle, keys=["vision/front/image/compressed"]))
        assert [each.number("seq") for each in before] == [None, *range(1, 20)]
        assert [each.key for each in recording.records(keys=["@vision/**"])] == [
            "@vision/node/tracker"
        ]
        with pytest.raises(ConfigurationError, match="key expression"):
            list(recording.records(keys=["a//b"]))


def test_foxglove_s_own_schemas_read_the_pictures(tmp_path: Path) -> None:
    path = written(tmp_path / "run.mcap", all_kinds())
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = {
            (schema.name, each.sequence): each_decoded
            for schema, _, each, each_decoded in reader.iter_decoded_messages()
        }
    picture = found["foxglove.CompressedImage", 7]
    assert picture.data == frame(7).payload
    assert (picture.format, picture.frame_id) == ("jpeg", "front")
    assert picture.timestamp.ToNanoseconds() == frame(7).number("stamp_ns")
    raw = found["foxglove.RawImage", 0]
    assert (raw.width, raw.height, raw.step, raw.encoding) == (4, 2, 12, "bgr8")
    assert raw.data == bytes(range(24))
    assert found["zenoh_vision.Sample", 7].zenoh_attachment == message(7).attachment


def test_the_schemas_agree_with_those_that_foxglove_publishes() -> None:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    from zv.bag import schemas

    names = ("CameraCalibration", "CompressedImage", "ImageAnnotations", "RawImage")
    files = [
        importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2").DESCRIPTOR
        for name in names
    ]
    for file in files:  # grows: all that they import
        files.extend(each for each in file.dependencies if each not in files)
    theirs = {
        f"{each.full_name}.{field.name}": (field.number, field.type)
        for file in files
        for each in file.message_types_by_name.values()
        for field in each.fields
    }
    compared = 0
    for schema in vars(schemas).values():
        if isinstance(schema, Schema) and schema.encoding == "protobuf":
            for file in FileDescriptorSet.FromString(schema.data).file:
                for each in file.message_type:
                    for field in each.field:
                        name = f"{file.package}.{each.name}.{field.name}"
                        if field.number < 100 and file.package != "zenoh_vision":
                            compared += 1
                            assert theirs[name] == (field.number, field.type), name
    assert compared > 40


def test_a_file_cut_at_any_byte_is_readable_up_to_its_last_whole_chunk(tmp_path: Path) -> None:
    records = all_kinds()
    whole = written(tmp_path / "run.mcap", records).read_bytes()
    with Recording(tmp_path / "run.mcap") as recording:
        chunks = list(recording.chunks)
        in_chunks = [
            len([each for each in records if each.log_time_ns <= chunk.last_ns]) for chunk in chunks
        ]
    picked = random.Random(1).sample(range(8, len(whole)), 200)
    for cut in [*picked, 8, 9, len(whole) - 1]:
        part = tmp_path / "cut.mcap.partial"
        part.write_bytes(whole[:cut])
        complete = sum(chunk.offset + chunk.length <= cut for chunk in chunks)
        with Recording(part) as recording:
            assert not recording.is_closed
            expected = in_chunks[complete - 1] if complete else 0
            assert list(recording.records()) == records[:expected], f"cut at {cut}"


def test_a_damaged_chunk_is_left_out_and_named(tmp_path: Path) -> None:
    records = all_kinds()
    path = written(tmp_path / "run.mcap", records)
    whole = bytearray(path.read_bytes())
    with Recording(path) as recording:
        chunk = recording.chunks[3]
    whole[chunk.offset + chunk.length // 2] ^= 1
    path.write_bytes(whole)
    with Recording(path) as recording:
        found = list(recording.records())
        left = [each for each in records if not chunk.first_ns <= each.log_time_ns <= chunk.last_ns]
        assert found == left
        assert f"the chunk at {chunk.offset} is damaged: its CRC is wrong" in recording.problems


def test_reading_resumes_after_a_damaged_record_of_a_file_without_index(tmp_path: Path) -> None:
    records = all_kinds()
    path = written(tmp_path / "run.mcap", records)
    whole = bytearray(path.read_bytes())
    with Recording(path) as recording:
        chunks = list(recording.chunks)
    place = chunks[3].offset
    whole[place : place + 40] = b"\xee" * 40
    path.write_bytes(whole[:-20])
    with Recording(path) as recording:
        assert [each.offset for each in recording.chunks] == [
            each.offset for each in chunks if each.offset != place
        ]
        assert any("are damaged" in each for each in recording.problems)
        lost = (chunks[3].first_ns, chunks[3].last_ns)
        left = [each for each in records if not lost[0] <= each.log_time_ns <= lost[1]]
        assert list(recording.records()) == left


@pytest.mark.parametrize(
    ("content", "error"),
    [
        (b"", "is empty"),
        (b"RIFF....AVI ", "begins with b'RIFF....'"),
        (b"\x89MCA", "begins with"),
    ],
)
def test_what_is_no_recording_is_refused_by_name(
    tmp_path: Path, content: bytes, error: str
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=error):
        Recording(path)
    with pytest.raises(RecordingError, match=r"y\.mcap: No such file"):
        Recording(tmp_path / "y.mcap")


@pytest.mark.parametrize("path", [".", "/"])
def test_a_folder_is_no_recording_to_write(path: str) -> None:
    with pytest.raises(RecordingError, match="is a folder; allowed: the name of a file"):
        Writer(Path(path))


def test_a_file_of_another_program_is_refused_with_what_to_do(tmp_path: Path) -> None:
    writer = Writer(tmp_path / "x.mcap")
    writer.add_message("/a", Schema("A", "", "cdr", "ros2msg", b"int8 a"), [b"12345"], 1, 1)
    with pytest.raises(RecordingError, match="zv bag import"):
        Recording(writer.close())


def test_a_newer_layout_is_refused(tmp_path: Path) -> None:
    writer = Writer(tmp_path / "x.mcap", {"a": "b"})
    writer.add_message("a", Schema("A", "sample.v2", "protobuf", "protobuf", b""), [b"12"], 1, 1)
    with Recording(writer.close()) as recording, pytest.raises(RecordingError, match="newer"):
        list(recording.records())


def test_a_file_is_private_and_gets_its_name_when_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    writer = Writer(path)
    writer.add(frame(0))
    partial = tmp_path / "run.mcap.partial"
    assert stat.S_IMODE(partial.stat().st_mode) == 0o600
    assert not path.exists()
    with pytest.raises(RecordingError, match="unless a recorder still writes it"):
        Writer(path)
    writer.close()
    assert not partial.exists()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with pytest.raises(RecordingError, match="exists already"):
        Writer(path)


def test_chunks_that_overlap_in_time_are_read_in_the_order_of_arrival(tmp_path: Path) -> None:
    records = [frame(seq) for seq in range(30)]
    shuffled = records[10:20] + records[:10] + records[20:]
    shuffled[9], shuffled[25] = shuffled[25], shuffled[9]
    with Recording(written(tmp_path / "run.mcap", shuffled)) as recording:
        assert list(recording.records()) == records


def test_the_capture_time_is_the_publish_time_and_the_number_the_sequence(tmp_path: Path) -> None:
    path = written(tmp_path / "run.mcap", [frame(5), replace(frame(6), attachment=header(2**32))])
    with path.open("rb") as file:
        found = [each for _, _, each in make_reader(file).iter_messages()]
    assert [each.sequence for each in found] == [5, 0]
    assert found[0].publish_time == frame(5).number("stamp_ns")
    assert found[0].log_time == frame(5).log_time_ns


def test_a_matcher_forgets_keys_of_which_there_are_too_many() -> None:
    matches = matcher(["vision/**"])
    for number in range(MAX_KEYS + 100):
        assert matches(f"vision/{number}")
        assert not matches(f"x/{number}")
    assert matches.cache_info().currsize == MAX_KEYS  # type: ignore[attr-defined]
