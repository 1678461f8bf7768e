"""``zv edge --image FILE``: the edges of every frame of a video or a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.fork_server import ZV
from tests.support.pictures.encoded import write_video
from tests.support.processes import Program
from tests.support.recordings import frames, write

Edge = Callable[..., Program]


@pytest.fixture
def edge(tmp_path: Path) -> Edge:
    """``edge("run.mcap", "--out", "edges")`` runs it in the test's folder."""
    number = 0

    def run(image: str, *words: str, status: int = 0) -> Program:
        nonlocal number
        number += 1
        words = ("edge", "--image", image, *words)
        with Program(words, tmp_path, f"edge{number}", forked=ZV, cwd=tmp_path) as program:
            assert program.process.wait(90) == status, program.complaints
        return program

    return run


def test_each_frame_of_a_recording_has_the_edges_of_its_picture(edge: Edge, tmp_path: Path):
    recorded = frames(6)
    write(tmp_path / "run.mcap", recorded)
    said = edge("run.mcap", "--out", "edges").complaints
    assert "run.mcap: the edges of 6 frames" in said
    names = sorted(path.name for path in (tmp_path / "edges").iterdir())
    assert names == [f"{seq:06d}.png" for seq in range(6)]
    (tmp_path / "frame.jpg").write_bytes(recorded[4].payload)
    edge("frame.jpg", "--out", "alone.png")
    assert (tmp_path / "edges/000004.png").read_bytes() == (tmp_path / "alone.png").read_bytes()


def test_a_frame_that_cannot_be_read_is_said_to_be_left_out(edge: Edge, tmp_path: Path):
    *whole, last = frames(3)
    write(tmp_path / "run.mcap", whole, [replace(last, payload=b"no picture")])
    said = edge("run.mcap", "--out", "edges").complaints
    assert "run.mcap: the edges of 2 frames" in said
    assert said.count("WARNING zv.camera.recorded: a recorded frame is skipped: ") == 1


def test_no_frame_of_a_video_is_left_out(edge: Edge, tmp_path: Path):
    write_video(tmp_path / "square.avi", frames=12, rate_hz=200)
    edge("square.avi", "--strength", "strengths")
    assert len(list((tmp_path / "strengths").iterdir())) == 12


def test_a_file_that_is_neither_image_nor_video_is_named(edge: Edge, tmp_path: Path):
    (tmp_path / "notes.dat").write_text("no picture")
    assert "notes.dat" in edge("notes.dat", "--out", "edges", status=3).complaints
