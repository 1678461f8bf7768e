"""The synthetic camera as a source: its pictures, their times, its faults."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from services.camera.scene.faults import parse_faults
from services.camera.scene.scene import Scene
from services.camera.sources.base import Picture, Source
from services.camera.sources.synthetic import SyntheticSource


class RecordedWaits(threading.Event):
    """An event that writes down how long it was waited for, instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self.waits_s: list[float | None] = []

    def wait(self, timeout: float | None = None) -> bool:
        self.waits_s.append(timeout)
        return self.is_set()


def source(faults: str = "", **changes: Any) -> SyntheticSource:
    settings: dict[str, Any] = {
        "width": 96,
        "height": 72,
        "rate_hz": 10.0,
        "seed": 5,
        "noise": 2.0,
        "objects": 4,
        "max_frames": 12,
    }
    return SyntheticSource(**{**settings, **changes}, faults=parse_faults(faults))


def all_of(opened: SyntheticSource) -> list[Picture]:
    pictures = []
    while (picture := opened.read()) is not None:
        pictures.append(picture)
    return pictures


def frame_numbers(pictures: list[Picture]) -> list[int]:
    """Which frames these are, by their due times at 10 Hz."""
    return [round((picture.due_s or 0.0) * 10) for picture in pictures]


def pixels_of(picture: Picture) -> np.ndarray[Any, np.dtype[Any]]:
    assert picture.pixels is not None
    return picture.pixels


def test_it_is_a_source_that_the_camera_paces() -> None:
    opened: Source = source()
    assert not opened.live
    assert opened.rate_hz == 10.0
    assert opened.description == "synthetic scene (96x72, 10 Hz, seed 5)"


def test_picture_k_is_frame_k_of_the_scene_with_its_truth() -> None:
    scene = Scene(96, 72, rate_hz=10.0, seed=5, noise=2.0, objects=4)
    pictures = all_of(source(max_frames=40))
    assert len(pictures) == 40
    for k, picture in enumerate(pictures):
        expected, truth = scene.frame(k)
        assert (picture.encoding, picture.width, picture.height) == ("bgr8", 96, 72)
        assert np.array_equal(pixels_of(picture), expected)
        assert picture.truth == truth
    assert pictures[39].truth


def test_frame_k_is_due_at_k_over_the_rate() -> None:
    due_s = [picture.due_s for picture in all_of(source(rate_hz=25.0, max_frames=4))]
    assert due_s == pytest.approx([0.0, 0.04, 0.08, 0.12])


def test_it_ends_after_max_frames_and_stays_ended() -> None:
    opened = source(max_frames=2)
    assert len(all_of(opened)) == 2
    assert opened.read() is None


def test_a_closed_source_delivers_no_more() -> None:
    opened = source(max_frames=None)
    assert opened.read() is not None
    opened.close()
    opened.close()
    assert opened.read() is None


def test_a_drop_skips_its_frames_without_waiting() -> None:
    stop = RecordedWaits()
    pictures = all_of(source("drop@3+4", stop=stop))
    assert frame_numbers(pictures) == [0, 1, 2, 7, 8, 9, 10, 11]
    assert stop.waits_s == []


def test_a_stall_blocks_for_its_frame_times_and_goes_on_with_the_frame_due_then() -> None:
    stop = RecordedWaits()
    pictures = all_of(source("stall@3+4", stop=stop))
    assert frame_numbers(pictures) == [0, 1, 2, 7, 8, 9, 10, 11]
    assert stop.waits_s == pytest.approx([0.4])  # 4 frames at 10 Hz


def test_a_stall_that_begins_inside_a_drop_blocks_for_what_is_left_of_it() -> None:
    stop = RecordedWaits()
    assert frame_numbers(all_of(source("drop@2+3,stall@4+4", stop=stop)))[2] == 8
    assert stop.waits_s == pytest.approx([0.3])  # frames 5, 6 and 7


def test_closing_ends_a_stall_at_once() -> None:
    opened = source("stall@1+1000000")
    assert opened.read() is not None
    results: list[Picture | None] = []
    reader = threading.Thread(target=lambda: results.append(opened.read()), daemon=True)
    reader.start()
    opened.close()
    reader.join(10.0)
    assert results == [None]


def test_a_frozen_source_repeats_exactly_one_picture_and_its_truth() -> None:
    pictures = all_of(source("frozen@21+5", max_frames=30))
    for repeated in pictures[22:26]:
        assert np.array_equal(pixels_of(repeated), pixels_of(pictures[21]))
        assert repeated.truth == pictures[21].truth
    for k in (20, 26):
        assert not np.array_equal(pixels_of(pictures[k]), pixels_of(pictures[21]))
    assert frame_numbers(pictures) == list(range(30))
    untouched = all_of(source(max_frames=30))
    assert np.array_equal(pixels_of(pictures[26]), pixels_of(untouched[26]))


def test_painting_on_a_frozen_picture_leaves_the_next_one_alone() -> None:
    opened = source("frozen@0+2")
    first, second = opened.read(), None
    assert first is not None
    before = pixels_of(first).copy()
    pixels_of(first)[:] = 0
    second = opened.read()
    assert second is not None
    assert np.array_equal(pixels_of(second), before)


def test_a_lighting_step_makes_its_frames_brighter_by_a_third_and_no_others() -> None:
    stepped = all_of(source("lighting@4+3", noise=0.0))
    plain = all_of(source(noise=0.0))
    for k, (one, other) in enumerate(zip(stepped, plain, strict=True)):
        ratio = float(pixels_of(one).mean()) / float(pixels_of(other).mean())
        # 1.35 in the light; a little less where bright places saturate.
        assert ratio == pytest.approx(1.35 if k in (4, 5, 6) else 1.0, abs=0.03)
        assert one.truth == other.truth
