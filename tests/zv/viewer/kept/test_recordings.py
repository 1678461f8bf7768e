"""Which recordings of a folder hold an event, and the command that shows it."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from tests.zv.bag.records import frame, written
from zv.tools.bag.play_options import MAX_S
from zv.viewer.kept.recordings import recordings_of
from zv.viewer.settings import ViewerSettings

MOMENT_NS = frame(150).log_time_ns


def test_a_recording_that_holds_the_moment_and_the_camera_is_found_with_its_command(tmp_path: Path):
    folder = tmp_path / "my runs"
    folder.mkdir()
    frames = [frame(seq) for seq in range(300)]
    written(folder / "run.mcap", frames)
    written(folder / "before.mcap", frames[:150])
    written(folder / "after.mcap", frames[151:])
    written(folder / "rear.mcap", [frame(seq, "rear") for seq in range(300)])
    (found,) = recordings_of(folder, "front", MOMENT_NS)
    assert (found["file"], found["at_s"]) == ("run.mcap", 5.0)
    zv, view, path, start, at = shlex.split(found["command"])
    assert (zv, view, path, start, at) == (
        "zv",
        "view",
        str(folder / "run.mcap"),
        "--start",
        "2.0s",
    )
    assert recordings_of(folder, "side", MOMENT_NS) == []
    (rear,) = recordings_of(folder, "rear", MOMENT_NS)
    assert rear["file"] == "rear.mcap"


def test_files_that_are_no_closed_recordings_are_left_out_and_too_old_ones_not_opened(
    tmp_path: Path,
):
    path = written(tmp_path / "run.mcap", [frame(seq) for seq in range(300)])
    whole = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.mcap").write_text("no recording")
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "run.mcap.partial").write_bytes(whole)
    assert [each["file"] for each in recordings_of(tmp_path, "front", MOMENT_NS)] == ["run.mcap"]
    os.utime(path, ns=(0, MOMENT_NS - 1))
    assert recordings_of(tmp_path, "front", MOMENT_NS) == []
    assert recordings_of(tmp_path / "missing", "front", MOMENT_NS) == []


def test_of_many_recordings_only_a_few_are_opened(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("zv.viewer.kept.recordings.MOST_OPENED", 2)
    for number in range(4):
        path = written(tmp_path / f"run{number}.mcap", [frame(seq) for seq in range(300)])
        os.utime(path, ns=(0, MOMENT_NS + number))
    found = recordings_of(tmp_path, "front", MOMENT_NS)
    assert [each["file"] for each in found] == ["run0.mcap", "run1.mcap"]


def test_the_command_of_any_recording_is_one_that_the_viewer_takes():
    assert ViewerSettings(recording="run.mcap", start=MAX_S).start == MAX_S
