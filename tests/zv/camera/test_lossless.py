"""Every frame of a file, read when it is asked for."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest

from tests.support.pictures.encoded import write_video
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.stream.counters import FrameCounters
from zv.camera import lossless
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import SourceOpener


def read(count: int, **settings: object) -> list[CapturedFrame]:
    store = ParameterStore(CameraSettings(**settings))  # type: ignore[arg-type]
    counters = FrameCounters("captured", "published")
    return list(islice(lossless.frames(store, counters, SourceOpener(), lambda: False), count))


def test_all_frames_of_a_video_have_the_times_of_the_video(tmp_path: Path):
    video = write_video(tmp_path / "square.avi", frames=20, rate_hz=25)
    found = read(100, source=str(video))
    assert [each.seq for each in found] == list(range(20))
    begun_ns = found[0].epoch
    assert {(each.epoch, each.replay) for each in found} == {(begun_ns, begun_ns)}
    times_s = [(each.stamp_ns - begun_ns) / 1e9 for each in found]
    assert times_s == pytest.approx([seq / 25 for seq in range(20)], abs=1e-3)


def test_a_given_rate_replaces_the_times_of_the_video(tmp_path: Path):
    video = write_video(tmp_path / "square.avi", frames=4, rate_hz=25)
    found = read(100, source=str(video), rate=10.0)
    assert [found[k].stamp_ns - found[0].stamp_ns for k in range(4)] == [
        0,
        100_000_000,
        200_000_000,
        300_000_000,
    ]


def test_with_loop_it_begins_again_in_another_epoch(tmp_path: Path):
    video = write_video(tmp_path / "square.avi", frames=3, rate_hz=25)
    found = read(7, source=str(video), loop=True)
    assert [each.seq for each in found] == [0, 1, 2, 0, 1, 2, 0]
    assert len({each.epoch for each in found}) == 3


def test_what_does_not_wait_is_refused():
    with pytest.raises(ConfigurationError, match="a synthetic source does not wait"):
        read(1, source="synthetic")
