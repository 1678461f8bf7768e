from __future__ import annotations

import os
from pathlib import Path

import pytest

from zenoh_vision.host.health_file import HealthFile


@pytest.fixture
def file(tmp_path: Path, monkeypatch) -> Path:
    found = tmp_path / "health"
    monkeypatch.setenv("ZV_HEALTH_FILE", str(found))
    return found


@pytest.fixture
def heartbeat(file: Path) -> HealthFile:
    """Of a node that has said that it is well."""
    found = HealthFile()
    found.beat()
    return found


def test_it_says_ok_and_what_is_wrong_and_ok_again(file: Path, heartbeat: HealthFile):
    assert file.read_text() == "ok\n"
    heartbeat.beat("the camera\nis gone")  # at once, however short the time since the last
    assert file.read_text() == "trouble: the camera is gone\n"
    heartbeat.beat()
    assert file.read_text() == "ok\n"
    assert list(file.parent.iterdir()) == [file]


def test_an_unchanged_state_is_not_written_again_at_once(file: Path, heartbeat: HealthFile):
    os.utime(file, (1, 1))
    heartbeat.beat()
    assert file.stat().st_mtime == 1


def test_a_full_disk_does_not_age_the_file(file: Path, heartbeat: HealthFile, monkeypatch):
    os.utime(file, (1, 1))

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr("zenoh_vision.host.health_file.PERIOD_S", 0.0)
    heartbeat._due_s = 0.0
    heartbeat.beat()
    assert file.stat().st_mtime > 1


def test_without_the_variable_nothing_is_written(tmp_path: Path, monkeypatch):
    monkeypatch.delenv("ZV_HEALTH_FILE", raising=False)
    monkeypatch.chdir(tmp_path)
    HealthFile().beat("trouble")
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_is_said_once_and_then_tried_again(
    tmp_path: Path, caplog, monkeypatch
):
    folder = tmp_path / "not there yet"
    monkeypatch.setenv("ZV_HEALTH_FILE", str(folder / "health"))
    heartbeat = HealthFile()
    heartbeat.beat()
    heartbeat.beat("x")
    heartbeat.beat()
    assert [record.message for record in caplog.records] == [
        f"ZV_HEALTH_FILE {folder / 'health'}: No such file or directory"
    ]
    folder.mkdir()
    heartbeat.beat("y")
    assert (folder / "health").read_text() == "trouble: y\n"
