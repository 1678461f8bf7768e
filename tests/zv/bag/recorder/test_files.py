"""Files of a recorder: rotation, the limit of space, a disk that fails, accounts."""

from __future__ import annotations

import errno
import os
import stat
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.waiting import wait_until
from tests.zv.bag.records import arrived, frame, message
from zv.bag.recorder.files import FLUSH_S, Files
from zv.bag.recorder.plan import Plan
from zv.bag.recorder.series import Series
from zv.bag.recording import Recording
from zv.bag.report import report_of
from zv.bag.samples import LogClock

STATE = [message(0, "camera_info", "vision.CameraInfo.v1")]


CLOCK = LogClock()


def files_of(plan: Plan) -> Files:
    return Files(plan, {"namespace": "vision"}, lambda: STATE, CLOCK)


def test_each_file_of_a_series_begins_with_the_state_and_misses_nothing(tmp_path: Path) -> None:
    files = files_of(Plan(tmp_path / "run.mcap", split_bytes=50_000))
    files.open()
    for seq in range(200):
        files.add(arrived(frame(seq), CLOCK))
        files.tick()
    files.stop()
    assert len(files.paths) > 3
    found = []
    for path in files.paths:
        with Recording(path) as recording:
            records = list(recording.records())
            assert (records[0].origin, records[0].payload) == ("query", STATE[0].payload)
            found += [each.number("seq") for each in records if each.origin == "stream"]
            report = report_of(recording)
            assert report.verdict == "complete"
            assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert found == list(range(200))


@pytest.mark.parametrize("sync_s", [0.0, 0.05])
def test_the_oldest_files_are_deleted_and_never_the_one_that_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sync_s: float
) -> None:
    # Not by the disk of this machine; a slow one closes several files at the end.
    monkeypatch.setattr(os, "fdatasync", lambda file: time.sleep(sync_s))
    other = tmp_path / "walk-20200101T000000_000Z.mcap"
    other.write_bytes(bytes(10**6))
    ours = tmp_path / "run-20200101T000000_000Z.mcap.partial"
    ours.write_bytes(bytes(100_000))
    files = files_of(Plan(tmp_path / "run.mcap", split_bytes=50_000, total_bytes=200_000))
    files.open()

    def is_closed() -> bool:
        files.tick()
        return not files._closing

    for seq in range(600):
        files.add(arrived(frame(seq), CLOCK))
        files.tick()
        if not sync_s:  # a fast disk keeps up on a busy machine, too
            wait_until(is_closed, poll_s=0.001)
    files.stop()
    assert other.exists()
    assert not ours.exists()
    left = [each for each in files.paths if each.exists()]
    assert files.paths[-1] in left
    assert len(left) < len(files.paths)
    # While too many wait for the disk, a file is not split: the newest may be over the limit alone.
    size = sum(each.stat().st_size for each in left)
    assert size <= 200_000 or (sync_s and left == files.paths[-1:])


@pytest.mark.quiet
def test_a_power_cut_takes_what_waits_for_its_chunk_and_for_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sync, synced = os.fdatasync, [(0, time.monotonic(), time.monotonic())]
    folders: list[int] = []

    def fdatasync(file: int) -> None:
        size, begun_s = os.fstat(file).st_size, time.monotonic()
        sync(file)
        synced.append((size, begun_s, time.monotonic()))

    monkeypatch.setattr(os, "fdatasync", fdatasync)
    monkeypatch.setattr(os, "fsync", folders.append)
    files = files_of(Plan(tmp_path / "run.mcap"))
    files.open()
    sent_s = [time.monotonic()]
    while sent_s[-1] - sent_s[0] < 3.0:
        files.add(arrived(frame(len(sent_s) - 1), CLOCK))
        files.tick()
        time.sleep(0.02)
        sent_s.append(time.monotonic())
    whole = (tmp_path / "run.mcap.partial").read_bytes()
    assert folders  # the file's name is kept, too
    files.stop()
    slowest_s = max(end_s - begun_s for _, begun_s, end_s in synced)
    slowest_s += max(after_s - before_s for before_s, after_s in pairwise(sent_s))
    bound_s = FLUSH_S + 0.1 + 2 * slowest_s
    cut = tmp_path / "cut.mcap"
    for (size, *_), (*_, until_s) in pairwise([*synced, (0, 0.0, sent_s[-1])]):
        seqs = set()
        if size:
            cut.write_bytes(whole[:size])
            with Recording(cut) as recording:
                seqs = {each.number("seq") for each in recording.records()}
        assert {seq for seq, at_s in enumerate(sent_s) if at_s < until_s - bound_s} <= seqs


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """``disk(False)`` makes it full: half of what is written to it then arrives, and an error."""
    write, state = os.pwritev, {"works": True}

    def pwritev(file: int, buffers: list[memoryview], place: int) -> int:
        if state["works"]:
            return write(file, buffers, place)
        write(file, buffers[: len(buffers) // 2], place)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def works(value: bool) -> None:
        state["works"] = value

    monkeypatch.setattr(os, "pwritev", pwritev)
    return works


def test_what_a_full_disk_cannot_take_is_counted_and_what_it_can_is_whole(
    tmp_path: Path, disk: Callable[[bool], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("zv.bag.recorder.files.FLUSH_S", 0.0)
    monkeypatch.setattr("zv.bag.recorder.files.HOLD_S", 0.0)
    files = files_of(Plan(tmp_path / "run.mcap"))
    files.open()
    for seq in range(30):
        disk(not 10 <= seq < 20)
        files.add(arrived(frame(seq), CLOCK))
        files.tick()
        assert bool(files.failure) == (10 <= seq < 20)
        if files.failure:
            assert files.failure.endswith("No space left on device")
    files.stop()
    with Recording(tmp_path / "run.mcap") as recording:
        seqs = [each.number("seq") for each in recording.records() if each.origin == "stream"]
        assert seqs == [*range(10), *range(20, 30)]
        report = report_of(recording)
        assert not recording.problems
    assert report.keys[0].missed == {"disk: No space left on device": 10}
    assert report.keys[0].bytes == 20 * len(frame(0).payload)
    assert report.verdict == "10 missed"


def test_a_file_that_cannot_be_closed_stays_partial_and_readable(
    tmp_path: Path, disk: Callable[[bool], None]
) -> None:
    files = files_of(Plan(tmp_path / "run.mcap"))
    files.open()
    for seq in range(10):
        files.add(arrived(frame(seq), CLOCK))
    files._attempt(files._writer.flush)  # type: ignore[union-attr]
    disk(False)
    files.stop()
    assert "cannot close" in files.failure
    assert not (tmp_path / "run.mcap").exists()
    with Recording(tmp_path / "run.mcap.partial") as recording:
        assert sum(each.origin == "stream" for each in recording.records()) == 10
        assert not recording.problems  # half a summary was taken back


def test_a_label_becomes_part_of_the_name_without_what_names_cannot_have(tmp_path: Path) -> None:
    series = Series(Plan(tmp_path / "run.mcap", last_s=5))
    path = series.next_path("../zone/ entered")
    assert path.parent == tmp_path
    assert path.name.endswith("Z-zone_entered.mcap")
    path.touch()
    again = series.next_path("../zone/ entered")
    assert again != path
    assert not again.exists()


def test_files_of_a_series_that_is_named_by_its_folder_have_the_time_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    series = Series(Plan(Path("."), last_s=5))
    path = series.next_path()
    path.touch()
    assert list(series.files()) == list(tmp_path.relative_to(tmp_path).iterdir()) == [path]
    assert path.name.endswith("Z.mcap")


def test_a_clock_that_was_set_is_noted_and_records_stay_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = LogClock()
    files = Files(Plan(tmp_path / "run.mcap"), {}, list, clock)
    files.open()
    before = clock.now_ns()
    monkeypatch.setattr("zv.bag.samples.time.time_ns", lambda: before - 3_600_000_000_000)
    assert clock.now_ns() >= before
    files.add(frame(0))
    files.stop()
    with Recording(tmp_path / "run.mcap") as recording:
        notes = report_of(recording).notes
    assert any("the wall clock was set by -36" in each for each in notes)


def test_keys_for_which_a_file_has_no_room_are_missed_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("zv.bag.writer.MAX_CHANNELS", 3)
    files = files_of(Plan(tmp_path / "run.mcap"))
    files.open()  # with the state, on a key of its own
    for seq in range(4):
        for camera in "abcd":
            files.add(arrived(frame(seq, camera), CLOCK))
    files.stop()
    with Recording(tmp_path / "run.mcap") as recording:
        verdicts = {each.key.split("/")[1]: each.verdict for each in report_of(recording).keys}
    missed = "missed 4 too_many_keys"
    assert verdicts == {"a": "complete", "b": "complete", "c": missed, "d": missed}
    assert caplog.text.count("vision/c/image/compressed is too many") == 1


def test_a_recording_for_ros_has_its_account_in_the_metadata(tmp_path: Path) -> None:
    files = files_of(Plan(tmp_path / "run.mcap", profile="ros2"))
    files.open()
    for seq in range(10):
        files.add(arrived(frame(seq), CLOCK))
        files.add(arrived(message(seq), CLOCK))  # without an object, for which ROS has no message
    files.add(arrived(message(0, "events", "vision.TrackEvent.v1"), CLOCK))
    files.stop()
    with Recording(tmp_path / "run.mcap") as recording:
        report = report_of(recording)
        assert {each.message_encoding for each in recording.channels()} == {"cdr"}
    assert {each.key: (each.count, each.verdict) for each in report.keys} == {
        "vision/front/image/compressed": (10, "complete"),
        "vision/front/centroid": (0, "not proven: 10 accounted for"),
    }


@pytest.mark.parametrize("profile", ["", "ros2"])
def test_a_lost_reply_is_not_taken_back_from_what_was_published(
    tmp_path: Path, disk: Callable[[bool], None], profile: str
) -> None:
    state = [arrived(frame(seq), CLOCK) for seq in range(3)]
    files = Files(Plan(tmp_path / "run.mcap", profile=profile), {}, lambda: state, CLOCK)
    files.open()
    files.add(arrived(frame(3), CLOCK))
    disk(False)
    files._attempt(files._writer.flush)  # type: ignore[union-attr]
    totals = files.ledger.totals
    disk(True)
    files.stop()
    assert (totals["taken"], totals["missed"]) == (0, 1)
