"""The frames of a recording as a source."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.recordings import centroids, frames, write
from zenoh_vision.errors import SourceError
from zenoh_vision.image.picture import JpegPicture
from zv.camera.recorded import RecordedSource
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.kinds import kind_of

FRAMES = frames(5, rate_hz=20)


def pictures(source: RecordedSource) -> list[TimedPicture]:
    found = list(iter(source.read, None))
    source.close()
    return [each for each in found if each is not None]


def test_every_frame_comes_undecoded_and_is_due_at_the_distance_of_its_stamp(tmp_path: Path):
    path = write(tmp_path / "run.mcap", FRAMES, centroids(FRAMES))
    assert kind_of(str(path)) == "recording"
    source = RecordedSource(path, "left")
    assert "vision/front/image/compressed, 320x240" in source.description
    found = pictures(source)
    assert [each.picture.data for each in found if isinstance(each.picture, JpegPicture)] == [
        each.payload for each in FRAMES
    ]
    assert [each.due_s for each in found] == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])


def test_a_frame_that_is_no_picture_is_skipped(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    broken = replace(FRAMES[2], payload=b"\xff\xd8nothing")
    path = write(tmp_path / "run.mcap", [*FRAMES[:2], broken, *FRAMES[3:]])
    with caplog.at_level(logging.WARNING):
        assert len(pictures(RecordedSource(path, "front"))) == 4
    assert "skipped" in caplog.text


def test_of_several_cameras_one_is_named(tmp_path: Path):
    left = frames(2, camera="left")
    path = write(tmp_path / "run.mcap", FRAMES, left)
    assert len(pictures(RecordedSource(path, "left"))) == 2
    with pytest.raises(SourceError, match="the cameras front, left, but not right"):
        RecordedSource(path, "right")


@pytest.mark.parametrize("parts", [[], [centroids(FRAMES)]])
def test_without_frames_it_is_no_source(tmp_path: Path, parts: list[list]):
    with pytest.raises(SourceError, match="no frames of a camera"):
        RecordedSource(write(tmp_path / "run.mcap", *parts), "front")
