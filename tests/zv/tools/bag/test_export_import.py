"""``zv bag export`` and ``import``, as they are called, on files that other programs read."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import stat
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import cv2
import msgpack
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from tests.support.pictures.encoded import write_video
from tests.support.recordings import write
from zenoh_vision.config.settings import Settings, load_settings
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zenoh_vision.transport.connection import Connection
from zv.bag.frames import frame_of
from zv.bag.record import Record, RecordingError
from zv.bag.recording import Recording
from zv.bag.writer import Writer
from zv.tools.bag import edit, export, import_, info
from zv.tools.bag.options import (
    ConvertOptions,
    CutOptions,
    ExportOptions,
    FilterOptions,
    ImportOptions,
    InfoOptions,
    MergeOptions,
    RepairOptions,
)
from zv.tools.bag.play_options import PlayOptions
from zv.tools.shared.output import Output

SIZE = (64, 48)
PERIOD_NS = 100_000_000
START_NS = 1_700_000_000_000_000_000


def picture(seq: int) -> np.ndarray:
    bgr = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    bgr[:, :, seq % 3] = 200
    return bgr


def header(seq: int) -> dict[str, object]:
    return {
        "camera": "front",
        "epoch": START_NS,
        "seq": seq,
        "stamp_ns": START_NS + seq * PERIOD_NS,
        "width": SIZE[0],
        "height": SIZE[1],
        "encoding": "bgr8",
        "node": "camera_front",
        "revision": 0,
    }


def records() -> list[Record]:
    found = []
    for seq in range(10):
        head, at = header(seq), START_NS + seq * PERIOD_NS
        jpeg = cv2.imencode(".jpg", picture(seq))[1].tobytes()
        packed = bytes(msgpack.packb(head))
        found.append(Record("vision/front/image/compressed", jpeg, "image/jpeg", packed, None, at))
        track = {"id": 4, "state": "confirmed", "x": 20.0, "y": 20.0, "box": [10, 12, 20, 16]}
        tracks = [{**track, "area": 1.0}, {**track, "area": 1.0, "id": 5, "state": "tentative"}]
        payload = bytes(msgpack.packb({"header": head, "tracks": tracks}))
        kind = "application/msgpack;vision.Tracks.v1"
        found.append(Record("vision/front/tracks", payload, kind, packed, None, at + 5_000_000))
    return found


@pytest.fixture
def run(tmp_path: Path) -> Path:
    writer = Writer(tmp_path / "run.mcap", {"namespace": "vision"})
    for record in records():
        writer.add(record)
    return writer.close()


@pytest.fixture
def zv(capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, object]]:
    runs = {
        ExportOptions: export.run,
        ImportOptions: import_.run,
        CutOptions: edit.cut,
        FilterOptions: edit.filter_,
        MergeOptions: edit.merge,
        ConvertOptions: edit.convert,
        RepairOptions: edit.repair,
        InfoOptions: info.run,
    }

    def call(options: object) -> dict[str, object]:
        capsys.readouterr()
        runs[type(options)](options, Connection(), Output(as_json=True))  # type: ignore[index]
        found: dict[str, object] = json.loads(capsys.readouterr().out)
        return found

    return call


def test_frames_are_the_bytes_that_were_recorded_with_their_headers(
    run: Path, tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    assert zv(ExportOptions(file=str(run), output=str(tmp_path / "frames")))["exported"] == 10
    with (tmp_path / "frames" / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["seq"]) for row in rows] == list(range(10))
    pictures = [each for each in records() if each.encoding == "image/jpeg"]
    for row, record in zip(rows, pictures, strict=True):
        assert (tmp_path / "frames" / row["file"]).read_bytes() == record.payload
        assert int(row["stamp_ns"]) == record.number("stamp_ns")


@pytest.mark.parametrize("draw", [False, True])
def test_a_video_has_the_frames_at_their_times(
    run: Path, tmp_path: Path, draw: bool, zv: Callable[..., dict[str, object]]
) -> None:
    zv(ExportOptions(file=str(run), output=str(tmp_path / "run.mp4"), draw=draw))
    with av.open(str(tmp_path / "run.mp4")) as container:
        frames = [
            (each.time, each.to_ndarray(format="bgr24")) for each in container.decode(video=0)
        ]
    assert [round(at or 0, 3) for at, _ in frames] == [round(seq / 10, 3) for seq in range(10)]
    for seq, (_, bgr) in enumerate(frames):
        assert abs(bgr[40, 50].astype(int) - picture(seq)[40, 50]).max() < 40
    edge = np.array([bgr[20, 10] for _, bgr in frames]).astype(int)
    plain = np.array([picture(seq)[20, 10] for seq in range(10)])
    assert (abs(edge - plain).max(axis=1) > 60).any() == draw


def test_a_video_for_which_the_disk_has_no_room_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", noise)[1].tobytes()
    size = {"width": 640, "height": 480}
    large = [
        replace(each, payload=jpeg, attachment=bytes(msgpack.packb(each.header | size)))
        for each in records()[::2]
    ]
    run = write(tmp_path / "large.mcap", large)  # more than libav keeps until the end

    class Full(io.BytesIO):
        name = "full"

        def write(self, data: Any) -> int:
            if self.tell() > 100_000:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return super().write(data)

    monkeypatch.setattr(export, "_new_file", lambda target, mode: nullcontext(Full()))
    target = tmp_path / "run.mp4"
    with pytest.raises(SourceError, match=f"cannot write {target}: No space left on device"):
        export.run(
            ExportOptions(file=str(run), output=str(target)), Connection(), Output(as_json=True)
        )


def test_confirmed_tracks_are_written_as_the_mot_challenge_has_them(
    run: Path, tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    zv(ExportOptions(file=str(run), output=str(tmp_path / "tracks.txt")))
    lines = (tmp_path / "tracks.txt").read_text().splitlines()
    assert lines == [f"{number},4,10,12,20,16,1,-1,-1,-1" for number in range(1, 11)]


def test_fields_of_messages_are_written_as_csv(
    run: Path, tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    fields = ("header.seq", "tracks.id")
    zv(ExportOptions(file=str(run), output=str(tmp_path / "x.csv"), field=fields))
    with (tmp_path / "x.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["header.seq"] for row in rows] == [str(seq) for seq in range(10)]
    assert rows[0]["tracks.id"] == "[4, 5]"
    with pytest.raises(ExpectationNotMet, match="has not all of nothing; it has header, tracks"):
        zv(ExportOptions(file=str(run), output=str(tmp_path / "y.csv"), field=("nothing",)))
    assert {each.name for each in tmp_path.iterdir()} == {"run.mcap", "x.csv"}


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"output": "x.avi"}, ConfigurationError, "allowed are FOLDER/"),
        ({"output": "x.txt", "draw": True}, ConfigurationError, "--draw is for FILE.mp4"),
        ({"output": "f", "key": "vision/left/image"}, ExpectationNotMet, "its keys: vision/front/"),
        ({"output": "run.mcap"}, ConfigurationError, "allowed are"),
        ({"output": "f", "start": 100.0}, ExpectationNotMet, "nothing on"),
    ],
)
def test_what_cannot_be_exported_is_said_and_leaves_no_file(
    run: Path,
    tmp_path: Path,
    options: dict[str, object],
    error: type[Exception],
    words: str,
    zv: Callable[..., dict[str, object]],
) -> None:
    target = str(tmp_path / str(options["output"]))
    with pytest.raises(error, match=words):
        zv(ExportOptions.model_validate({"file": str(run), **options, "output": target}))
    assert {each.name for each in tmp_path.iterdir()} == {"run.mcap"}


def test_an_existing_output_is_not_overwritten(
    run: Path, tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    for name in ("x.csv", "x.mcap"):
        (tmp_path / name).write_text("mine")
    with pytest.raises(SourceError, match="exists already"):
        zv(ExportOptions(file=str(run), output=str(tmp_path / "x.csv")))
    with pytest.raises(RecordingError, match="exists already"):
        zv(CutOptions(file=str(run), output=str(tmp_path / "x.mcap"), start=0.1))
    with pytest.raises(ExpectationNotMet, match="nothing is left"):
        zv(FilterOptions(file=str(run), output=str(tmp_path / "y.mcap"), keys=("a/b",)))
    assert (tmp_path / "x.csv").read_text() == "mine"
    assert {each.name for each in tmp_path.iterdir()} == {"run.mcap", "x.csv", "x.mcap"}


@pytest.mark.parametrize(
    ("options", "more", "messages"),
    [
        (CutOptions, {"start": 0.5}, 10),
        (MergeOptions, {}, 20),
        (FilterOptions, {"exclude": ("vision/*/tracks",)}, 10),
        (ConvertOptions, {}, 20),
        (RepairOptions, {}, 20),
    ],
)
def test_a_new_recording_has_as_many_messages_as_info_counts(
    tmp_path: Path,
    options: type[Settings],
    more: dict[str, Any],
    messages: int,
    zv: Callable[..., dict[str, Any]],
) -> None:
    state = Record("vision/front/camera_info", b"1", "text/plain", log_time_ns=START_NS)
    write(tmp_path / "run.mcap", [replace(state, origin="query"), *records()])
    target, source = str(tmp_path / "new.mcap"), str(tmp_path / "run.mcap")
    if options is RepairOptions:  # of one for ROS, in which boxes are beside the tracks
        zv(ConvertOptions(file=source, output=str(tmp_path / "ros.mcap")))
        source = str(tmp_path / "ros.mcap")
    files = {"files": (source,)} if options is MergeOptions else {"file": source}
    assert zv(options(**files, output=target, **more))["messages"] == messages
    assert sum(each["messages"] for each in zv(InfoOptions(file=target))["keys"]) == messages


def test_a_folder_of_images_becomes_a_camera_with_the_files_as_they_are(
    tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    for seq in range(12):
        cv2.imwrite(str(folder / f"{seq}.{'png' if seq % 2 else 'jpg'}"), picture(seq))
    target = tmp_path / "x.mcap"
    options = ImportOptions(source=str(folder), output=str(target), camera="left", rate=5.0)
    assert zv(options)["messages"] == 12
    with Recording(target) as recording:
        found = list(recording.records())
    assert [each.payload for each in found] == [
        (folder / f"{seq}.{'png' if seq % 2 else 'jpg'}").read_bytes() for seq in range(12)
    ]
    assert {each.key for each in found} == {"vision/left/image/compressed"}
    assert [each.encoding for each in found[:2]] == ["image/jpeg", "image/png"]
    stamps = [each.number("stamp_ns") or 0 for each in found]
    assert {after - before for before, after in pairwise(stamps)} == {200_000_000}


def test_an_image_that_says_it_is_from_before_1970_is_imported(
    tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    image = tmp_path / "images" / "1.png"
    image.parent.mkdir()
    cv2.imwrite(str(image), picture(0))
    os.utime(image, (-3600, -3600))
    options = ImportOptions(source=str(image.parent), output=str(tmp_path / "x.mcap"))
    assert zv(options)["messages"] == 1


def test_a_video_becomes_a_camera(tmp_path: Path, zv: Callable[..., dict[str, object]]) -> None:
    video = tmp_path / "walk.avi"
    write_video(video, frames=7, rate_hz=10)
    target = tmp_path / "x.mcap"
    zv(ImportOptions(source=str(video), output=str(target), lossless=True))
    with av.open(str(video)) as container:
        count = sum(1 for _ in container.decode(video=0))
    with Recording(target) as recording:
        found = list(recording.records())
    assert [each.number("seq") for each in found] == list(range(count))
    assert all(cv2.imdecode(np.frombuffer(each.payload, np.uint8), 1) is not None for each in found)
    (tmp_path / "notes.avi").write_text("no video")
    for name, words in (
        ("notes.avi", "not a video"),
        ("x.mcap", "not ros2"),
        ("z", "no such file"),
    ):
        with pytest.raises(SourceError, match=words):
            zv(ImportOptions(source=str(tmp_path / name), output=str(tmp_path / "y.mcap")))


def ros_messages(store: object, is_old: bool) -> list[tuple[str, str, object]]:
    types = store.types  # type: ignore[attr-defined]
    time = types["builtin_interfaces/msg/Time"](START_NS // 10**9, 5)
    extra = (1,) if is_old else ()
    head = types["std_msgs/msg/Header"](*extra, time, "cam")
    pixels = picture(0)
    jpeg = np.frombuffer(cv2.imencode(".jpg", pixels)[1].tobytes(), np.uint8)
    raw = types["sensor_msgs/msg/Image"](
        head, SIZE[1], SIZE[0], "bgr8", 0, SIZE[0] * 3, pixels.reshape(-1)
    )
    roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.eye(3).reshape(-1)
    p = np.eye(3, 4).reshape(-1)
    info = types["sensor_msgs/msg/CameraInfo"](
        head, SIZE[1], SIZE[0], "plumb_bob", np.zeros(5), k, k, p, 0, 0, roi
    )
    return [
        (
            "/left/image_raw/compressed",
            "sensor_msgs/msg/CompressedImage",
            types["sensor_msgs/msg/CompressedImage"](head, "jpeg", jpeg),
        ),
        ("/right/image_raw", "sensor_msgs/msg/Image", raw),
        ("/left/camera_info", "sensor_msgs/msg/CameraInfo", info),
    ]


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_recording_of_ros_becomes_cameras(
    tmp_path: Path, kind: str, zv: Callable[..., dict[str, object]]
) -> None:
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_JAZZY)
    source = tmp_path / ("drive.bag" if kind == "ros1" else "drive")
    if kind == "ros1":
        writer: object = Ros1Writer(source)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Ros2Writer(source, version=9, storage_plugin=plugin)
    with writer:  # type: ignore[attr-defined]
        for number, (topic, name, message) in enumerate(ros_messages(store, kind == "ros1")):
            connection = writer.add_connection(topic, name, typestore=store)  # type: ignore[attr-defined]
            serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            writer.write(connection, START_NS + number, serialize(message, name))  # type: ignore[attr-defined]
    target = tmp_path / "x.mcap"
    zv(ImportOptions(source=str(source), output=str(target), lossless=True))
    with Recording(target) as recording:
        found = {each.key: each for each in recording.records()}
    assert set(found) == {
        "vision/left/image/compressed",
        "vision/right/image/compressed",
        "vision/left/camera_info",
    }
    right = found["vision/right/image/compressed"]
    decoded = cv2.imdecode(np.frombuffer(right.payload, np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(decoded, picture(0))
    assert right.number("stamp_ns") == START_NS // 10**9 * 10**9 + 5
    assert msgpack.unpackb(found["vision/left/camera_info"].payload)["k"] == list(np.eye(3).flat)


@pytest.mark.parametrize("damage", ["cut off", "overwritten", "one frame"])
def test_a_damaged_video_says_how_much_of_it_was_read(
    tmp_path: Path, damage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    video = write_video(tmp_path / "walk.avi", frames=30, rate_hz=10)
    data = video.read_bytes()
    middle = len(data) // 2
    if damage == "cut off":
        data = data[:middle]
    elif damage == "overwritten":
        data = data[:middle] + b"\xee" * 3000 + data[middle + 3000 :]
    else:
        begin = data.find(b"00dc", middle) + 8
        size = int.from_bytes(data[begin - 4 : begin], "little")
        data = data[:begin] + b"\xaa" * size + data[begin + size :]
    video.write_bytes(data)
    target = tmp_path / "x.mcap"
    import_.run(
        ImportOptions(source=str(video), output=str(target)), Connection(), Output(as_json=False)
    )
    with Recording(target) as recording:
        count = sum(1 for _ in recording.records())
    assert 10 < count < 30
    assert count == 29 or damage == "cut off"
    said = capsys.readouterr().err
    assert f"walk.avi: damaged: it has 30 frames by its header, and {count} could be read" in said


def test_pictures_that_ros_has_twice_are_imported_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    compressed, raw, _ = ros_messages(store, False)
    name = "sensor_msgs/msg/Image"
    with Ros2Writer(tmp_path / "drive", version=9) as writer:
        for topic, kind, message in (
            ("/left/image_raw", name, raw[2]),
            compressed,
            ("/left/image_rect", name, raw[2]),
        ):
            connection = writer.add_connection(topic, kind, typestore=store)
            writer.write(connection, START_NS, store.serialize_cdr(message, kind))
    target = tmp_path / "x.mcap"
    options = ImportOptions(source=str(tmp_path / "drive"), output=str(target))
    import_.run(options, Connection(), Output())
    with Recording(target) as recording:
        (found,) = recording.records()
    assert found.payload == bytes(compressed[2].data)  # type: ignore[attr-defined]
    said = capsys.readouterr().err
    for topic in ("/left/image_raw", "/left/image_rect"):
        assert f"{topic} is left out: /left/image_raw/compressed has the pictures of" in said


@pytest.mark.parametrize("damage", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 50])
def test_a_damaged_message_of_ros_is_left_out_and_said(
    tmp_path: Path, damage: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    (topic, name, message), *_ = ros_messages(store, False)
    whole = store.serialize_cdr(message, name)
    with Ros2Writer(tmp_path / "drive", version=9) as writer:
        connection = writer.add_connection(topic, name, typestore=store)
        for number, data in enumerate((whole, damage, whole)):
            writer.write(connection, START_NS + number, data)
    target = tmp_path / "x.mcap"
    import_.run(
        ImportOptions(source=str(tmp_path / "drive"), output=str(target)), Connection(), Output()
    )
    with Recording(target) as recording:
        assert [each.number("seq") for each in recording.records()] == [0, 1]
    assert f"{topic}: a message is left out: " in capsys.readouterr().err


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    """A recording whose first and fifth message of each key cannot be read."""
    writer = Writer(tmp_path / "damaged.mcap", {"namespace": "vision"})
    for number, record in enumerate(records()):
        is_damaged = number // 2 in (0, 4)
        writer.add(replace(record, payload=b"\xc1\xff") if is_damaged else record)
    return writer.close()


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("x.txt", {}),
        ("x.csv", {"key": "vision/front/tracks"}),
        ("x.csv", {"key": "vision/front/tracks", "field": ("header.seq",)}),
        ("x.mp4", {}),
    ],
)
def test_messages_that_cannot_be_read_are_left_out_and_counted(
    damaged: Path,
    tmp_path: Path,
    name: str,
    options: dict[str, object],
    capsys: pytest.CaptureFixture[str],
) -> None:
    target = tmp_path / name
    fields = {"file": str(damaged), "output": str(target), **options}
    export.run(ExportOptions.model_validate(fields), Connection(), Output(as_json=True))
    said = capsys.readouterr()
    assert json.loads(said.out) == {"file": str(target), "exported": 8, "left_out": 2}
    assert "2 messages could not be read, and are left out" in said.err
    if name == "x.csv":
        with target.open() as file:
            assert [row["header.seq"] for row in csv.DictReader(file)] == list("12356789")


def test_a_message_without_the_field_is_left_out_and_counted(
    run: Path, tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    writer = Writer(tmp_path / "mixed.mcap", {"namespace": "vision"})
    for number, record in enumerate(records()):
        other = bytes(msgpack.packb({"other": 1}))
        writer.add(replace(record, payload=other) if number % 2 and number < 4 else record)
    source = str(writer.close())
    options = {"file": source, "output": str(tmp_path / "x.csv"), "field": ("tracks.id",)}
    assert zv(ExportOptions.model_validate(options))["left_out"] == 2
    assert len((tmp_path / "x.csv").read_text().splitlines()) == 1 + 8


def test_a_video_is_private_while_it_is_written(
    run: Path,
    tmp_path: Path,
    zv: Callable[..., dict[str, object]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    modes: set[int] = set()

    def noted(record: Record) -> object:
        modes.add(stat.S_IMODE((tmp_path / "run.mp4.partial").stat().st_mode))
        return frame_of(record)

    monkeypatch.setattr("zv.tools.bag.video.frame_of", noted)
    zv(ExportOptions(file=str(run), output=str(tmp_path / "run.mp4")))
    assert modes == {0o600}
    assert stat.S_IMODE((tmp_path / "run.mp4").stat().st_mode) == 0o600


def test_a_part_after_the_end_is_refused(
    run: Path, tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    with pytest.raises(ConfigurationError, match=r"--start 2 s: the recording is 0.9 s long"):
        zv(CutOptions(file=str(run), output=str(tmp_path / "part.mcap"), start=2.0))
    assert {each.name for each in tmp_path.iterdir()} == {"run.mcap"}


def test_the_keys_that_a_recording_has_are_told_without_those_of_the_system(
    tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    writer = Writer(tmp_path / "run.mcap", {"namespace": "vision"})
    for record in (replace(records()[0], key="@vision/node/camera_front"), *records()):
        writer.add(record)
    wrong = ExportOptions(file=str(writer.close()), output=str(tmp_path / "f"), key="vision/x")
    with pytest.raises(ExpectationNotMet) as caught:
        zv(wrong)
    assert str(caught.value).endswith(
        "has no vision/x; its keys: vision/front/image/compressed, vision/front/tracks"
    )


def test_a_recording_without_pictures_has_none_to_export(
    tmp_path: Path, zv: Callable[..., dict[str, object]]
) -> None:
    run = str(Writer(tmp_path / "run.mcap", {"namespace": "vision"}).close())
    with pytest.raises(ExpectationNotMet, match=r"run\.mcap has no pictures$"):
        zv(ExportOptions(file=run, output=str(tmp_path / "f")))


@pytest.mark.parametrize("model", [CutOptions, ExportOptions, PlayOptions])
def test_a_part_that_ends_before_it_starts_is_refused(model: type[Settings]):
    flags = {"file": "a.mcap", "start": "2s", "end": "1s"}
    flags |= {"output": "b"} if "output" in model.model_fields else {}
    with pytest.raises(ConfigurationError, match="--end 1 s is not after --start 2 s"):
        load_settings(model, flags=flags)
