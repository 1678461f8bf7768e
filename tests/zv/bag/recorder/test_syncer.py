"""The recorder does not wait for the disk, and the disk keeps each chunk as early as it can.

A sync ends when a test says so, so no machine is too slow. From these follows what a power cut can
take at most: what waits for its chunk, and what came during the sync that goes on and the one
before it. It does not follow how long a file system has a write wait for a sync of another file,
which is one sync more where a file begins: so ext4 in a virtual machine, of which power was cut.
"""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from tests.support.power_cut import LoggedDisk, Sync, Write
from tests.support.waiting import wait_until
from tests.zv.bag.records import Camera, arrived, frame, seqs_in
from zv.bag.recorder.files import FLUSH_S
from zv.bag.recorder.plan import Plan


def held(disk: LoggedDisk, count: int) -> list[Sync]:
    """Return the syncs that wait for the disk, once there are so many."""
    return wait_until(lambda: found if len(found := disk.going_on()) >= count else None) or []


def test_the_recorder_never_waits_for_the_disk(
    tmp_path: Path, disk: LoggedDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = Camera(Plan(tmp_path / "run.mcap", split_s=2.0), monkeypatch)
    camera.files.open()
    for _ in range(60):
        camera.send(seconds=0.1)
    camera.files.close()
    assert len({each.file for each in disk.syncs}) > 2  # several files, and the folder
    assert threading.get_ident() not in {each.thread for each in disk.syncs}
    camera.files.stop()


def test_a_chunk_waits_for_no_more_than_the_sync_that_goes_on_and_its_own(
    tmp_path: Path, disk: LoggedDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk.hold()
    camera = Camera(Plan(tmp_path / "run.mcap"), monkeypatch)
    camera.files.open()
    (naming,) = held(disk, 1)
    assert naming.file is None  # the name, while the first chunk is not yet due
    for _ in range(4):
        written = len(disk.log)
        camera.send(seconds=FLUSH_S)  # a chunk each
        assert any(isinstance(each, Write) for each in disk.log[written:])
        (before,) = held(disk, 1)
        last = len(disk.log)
        disk.end_one()
        (its_own,) = wait_until(
            lambda one=before: [each for each in disk.going_on() if each is not one]
        )
        assert its_own.file is not None
        assert its_own.begin >= last
    disk.release()
    camera.files.stop()


def test_the_next_file_does_not_wait_until_the_disk_has_those_before(
    tmp_path: Path, disk: LoggedDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = Camera(Plan(tmp_path / "run.mcap", split_s=2.0), monkeypatch)
    camera.files.open()
    disk.hold()
    for number in (2, 3, 4):
        while len(list(tmp_path.iterdir())) < number:
            camera.send(seconds=FLUSH_S)
        assert len({each.thread for each in held(disk, number)}) == number  # one of each file
    assert len(list(tmp_path.glob("*.partial"))) == 4
    assert camera.files.paths == []
    disk.release()
    camera.files.stop()
    assert len(camera.files.paths) == 4
    assert seqs_in(camera.files.paths) == list(range(camera.sent))


def test_a_disk_that_is_far_behind_gets_a_larger_file_and_not_more_files(
    tmp_path: Path, disk: LoggedDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = Camera(Plan(tmp_path / "run.mcap", split_s=1.0), monkeypatch)
    camera.files.open()
    disk.hold()
    for _ in range(100):
        camera.send(seconds=FLUSH_S)
    assert len(list(tmp_path.iterdir())) == 5
    disk.release()
    camera.files.stop()
    assert seqs_in(camera.files.paths) == list(range(camera.sent))


def test_the_last_seconds_are_synced_while_they_are_written(
    tmp_path: Path, disk: LoggedDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = Camera(Plan(tmp_path / "box.mcap", last_s=30), monkeypatch)
    camera.files.open("jam")
    for seq in range(30):  # a disk so slow that each record takes a tenth of a second
        camera.files.add(arrived(frame(seq), camera.clock))
        camera.now_s += 0.1
    wait_until(lambda: any(each.file is not None for each in disk.syncs))
    camera.files.stop()
