"""``zv track``: a table of the tracks of every frame of a file."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import pytest

from tests.support import detector_models
from tests.support.fork_server import ZV
from tests.support.processes import Program
from tests.support.recordings import frames, write
from tests.support.waiting import wait_until

FRAMES = frames(45, still=25)

Track = Callable[..., Program]


@pytest.fixture
def track(tmp_path: Path) -> Track:
    """``track("run.mcap", "-o", "tracks.csv")`` starts it in a folder with that recording."""
    write(tmp_path / "run.mcap", FRAMES)
    number = 0

    def start(*words: object) -> Program:
        nonlocal number
        number += 1
        return Program(["track", *words], tmp_path, f"track{number}", forked=ZV, cwd=tmp_path)

    return start


def finished(program: Program, status: int = 0) -> str:
    with program:
        assert program.process.wait(90) == status, program.complaints
    return program.output + program.complaints


def test_every_frame_is_tracked_and_confirmed_tracks_are_the_same_in_the_format_of_motchallenge(
    track: Track, tmp_path: Path
):
    for name in ("tracks.csv", "tracks.txt"):
        assert f"{name}: 45 frames, 1 objects" in finished(track("run.mcap", "-o", name))
    with (tmp_path / "tracks.csv").open() as file:
        rows = list(csv.DictReader(file))
    last = rows[-1]
    assert (last["frame"], last["id"], last["state"]) == ("44", "1", "confirmed")
    assert float(last["time_s"]) == pytest.approx(44 / 30, abs=1e-3)
    # The square of 40 pixels begins at 10, 100 and moves by 6 pixels a frame.
    assert float(last["x"]) == pytest.approx(10 + 6 * 19 + 20, abs=3)
    assert float(last["y"]) == pytest.approx(120, abs=3)
    assert float(last["vx"]) == pytest.approx(180, abs=10)
    # Another run has found the same; its frames count from 1.
    lines = (tmp_path / "tracks.txt").read_text().splitlines()
    found = [line.split(",") for line in lines]
    confirmed = [row for row in rows if row["state"] == "confirmed"]
    assert [(int(row[0]) - 1, row[1]) for row in found] == [
        (int(row["frame"]), row["id"]) for row in confirmed
    ]
    lefts = [float(row["left"]) for row in confirmed]
    assert [float(row[2]) for row in found] == pytest.approx(lefts, abs=0.01)
    assert {tuple(row[6:]) for row in found} == {("1", "-1", "-1", "-1")}


def test_the_table_of_a_model_says_class_and_score(track: Track, tmp_path: Path):
    detector_models.save(tmp_path / "tiny.onnx", "yolov8")
    (tmp_path / "walk").mkdir()
    for number in range(8):
        box = (20 + 4 * number, 60, 60 + 4 * number, 140)
        picture = detector_models.scene({1: box}, (320, 240))
        cv2.imwrite(str(tmp_path / "walk" / f"{number}.png"), picture)
    model = ("--pipeline", "detector", "--model", "tiny.onnx")
    assert "t.csv: 8 frames, 1 objects" in finished(track("walk", "-o", "t.csv", *model))
    with (tmp_path / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["class"], row["score"]) for row in rows] == [("green", "0.8")] * 8


def test_a_frame_that_cannot_be_read_is_said_to_be_left_out(track: Track, tmp_path: Path):
    write(tmp_path / "damaged.mcap", FRAMES[:5], [replace(FRAMES[5], payload=b"no picture")])
    said = finished(track("damaged.mcap", "-o", "tracks.csv"))
    assert "tracks.csv: 5 frames" in said
    assert said.count("WARNING zv.camera.recorded: a recorded frame is skipped: ") == 1


def test_told_to_stop_it_leaves_no_table(track: Track, tmp_path: Path):
    with track("run.mcap", "-o", "tracks.csv") as program:
        wait_until(lambda: (tmp_path / "tracks.csv.partial").exists())
        assert program.interrupt() in (0, 1)  # 0: it was not yet at work
    assert not list(tmp_path.glob("tracks.csv*"))


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["run.mcap", "--image", "a.jpg", "-o", "t.csv"], 2, "not both"),
        (["run.mcap", "-o", "t.csv", "--camera", "a,b"], 2, "one camera"),
        (["none.avi", "-o", "t.csv"], 3, "none.avi: no such file or folder"),
        (["run.mcap", "-o", "t.xls"], 2, "ends in .csv or .txt"),
        (["run.mcap", "-o", "none/t.csv"], 3, "none/t.csv"),
        (["run.mcap"], 2, "-o tracks.csv"),
        (["synthetic", "-o", "t.csv"], 2, "a synthetic source does not wait"),
    ],
)
def test_what_cannot_be_done_is_said(
    track: Track, tmp_path: Path, words: list[str], status: int, said: str
):
    assert said in finished(track(*words), status)
    assert not list(tmp_path.glob("t.*"))
