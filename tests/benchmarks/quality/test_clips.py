"""Clips are received and scored as their README says, by constants that they did not choose."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.quality.data import data_folder
from benchmarks.quality.tracker.ablation import AS_IT_IS, CONSTANTS, RULES, alternatives, chosen
from benchmarks.quality.tracker.baselines import Sort
from benchmarks.quality.tracker.clips import Clip, Plain, seen_otherwise
from benchmarks.quality.tracker.degradation import degraded
from benchmarks.quality.tracker.scoring import Score
from benchmarks.quality.tracker.wire import Receiver
from zenoh_vision.messages import Centroid, Header, Track, Tracks
from zv.tracker.pipelines.robust import RobustTracker


def score(value: float) -> Score:
    return Score(value, value, 0, 0, 0, 100, 0.0, 100)


def test_alternatives_are_chosen_by_the_other_clips():
    """In each way in which a clip is seen, it is left out."""
    usual = {"a": score(50), "a, mirrored": score(50), "b": score(50), "c": score(50)}
    good_for_a = usual | {"a": score(99), "a, mirrored": score(99)}
    found = {AS_IT_IS: usual, "other": good_for_a}
    assert [chosen(found, name) for name in "abc"] == [AS_IT_IS, "other", "other"]


def test_each_rule_and_constant_that_is_changed_exists_and_has_another_value():
    (_, usual), *others = alternatives()
    assert len(others) == len(RULES) + 2 * len(CONSTANTS)
    assert all(other != usual for _, other in others)


def test_a_clip_seen_otherwise_has_the_truth_of_the_pictures_that_are_left():
    """Of 100 pictures at 20 Hz: every second one; and so from the 28th on, mirrored."""
    pictures = np.zeros((100, 4, 8, 3), np.uint8)
    for index in range(100):
        pictures[index, 0, 0] = index
    truth = {index: {7: (10.0, 5.0, 20.0, 30.0)} for index in range(100)}
    clip = Clip("hall", pictures, (80, 40), 20.0, 10, truth, {28: {9: (0.0, 0.0, 8.0, 8.0)}})
    slow, other = seen_otherwise(clip)
    assert (slow.rate_hz, slow.first, len(slow.pictures)) == (10.0, 5, 50)
    assert slow.pictures[3, 0, 0, 0] == 6
    assert slow.truth[49] == {7: (10.0, 5.0, 20.0, 30.0)}
    assert (other.rate_hz, other.first, len(other.pictures)) == (10.0, 10, 36)
    assert other.pictures[1, 0, -1, 0] == 30
    assert other.truth[35] == {7: (50.0, 5.0, 20.0, 30.0)}
    assert other.ignored == {0: {9: (72.0, 0.0, 8.0, 8.0)}}


def test_a_degraded_clip_has_other_pictures_and_the_same_truth_where_they_show_it():
    picture = np.random.default_rng(0).integers(60, 200, (40, 60, 3), np.uint8)
    truth = {index: {7: (10.0, 20.0, 30.0, 40.0)} for index in range(5)}
    clip = Clip("hall", np.stack([picture] * 5), (120, 80), 10.0, 1, truth, {})
    found = dict(degraded(clip))
    usual, smaller = found.pop("as it is"), found.pop("0.6 of the size")
    assert len(found) == 6
    assert np.array_equal(usual.pictures, clip.pictures)
    for name, other in found.items():
        assert other.pictures.shape == clip.pictures.shape, name
        assert not np.array_equal(other.pictures, clip.pictures), name
        assert (other.truth, other.size) == (clip.truth, clip.size), name
    brighter, darker = found["brighter, gamma 0.6"], found["darker, gamma 1.6"]
    assert darker.pictures.mean() < picture.mean() < brighter.pictures.mean()
    assert (smaller.pictures.shape, smaller.size) == ((5, 24, 36, 3), (72, 48))
    assert smaller.truth[3] == {7: (6.0, 12.0, 18.0, 24.0)}


def test_a_plain_baseline_finds_what_moves():
    class Subtractor:
        def apply(self, picture: np.ndarray) -> np.ndarray:
            return np.ascontiguousarray(picture[..., 0])

    plain, picture = Plain(Subtractor(), Sort()), np.zeros((60, 80, 3), np.uint8)
    picture[20:40, 30:50] = 255
    (box,) = plain.update(picture, 0, (160, 120)).values()
    assert box == pytest.approx((60, 40, 40, 40), abs=3)


def same(levels: np.ndarray) -> np.ndarray:
    return levels


@pytest.mark.skipif(
    not (data_folder() / "clips" / "emptyroom").exists(), reason="no clips: set ZV_TEST_DATA"
)
@pytest.mark.parametrize(
    "tone",
    [
        pytest.param(same, id="the same light"),
        pytest.param(lambda levels: 1.4 * levels, id="more gain"),
        pytest.param(lambda levels: 0.6 * levels, id="less gain"),
        pytest.param(lambda levels: 255 * (levels / 255) ** 0.7, id="gamma"),
        pytest.param(lambda levels: levels * np.array([1.2, 1.0, 0.8]), id="white balance"),
    ],
)
def test_light_that_changes_in_an_empty_room_is_no_object(tone: Callable[[np.ndarray], np.ndarray]):
    from benchmarks.quality.tracker.clips import clips

    clip = next(each for each in clips() if each.name == "emptyroom")
    robust = RobustTracker()
    for index, picture in enumerate(clip.pictures):
        levels = picture.astype(np.float32)
        seen = np.clip(tone(levels) if index >= 60 else levels, 0, 255).astype(np.uint8)
        tracks = robust.update(seen, round(index * 1e9 / clip.rate_hz), clip.size)
        assert all(track.state == "tentative" for track in tracks)


def sample(message: Tracks | Centroid) -> SimpleNamespace:
    """Return what a subscriber gets, as far as it is read."""
    return SimpleNamespace(payload=SimpleNamespace(to_bytes=message.to_bytes))


def header(seq: int, epoch: int = 5) -> Header:
    return Header(camera="front", epoch=epoch, seq=seq, stamp_ns=1, width=64, height=48)


def track(identity: int, state: str) -> Track:
    return Track(id=identity, state=state, x=5, y=10, box=(0, 0, 10, 20), area=150)


def test_confirmed_tracks_are_kept_by_the_number_of_their_frame():
    receiver = Receiver()
    tracks = (track(1, "confirmed"), track(2, "tentative"), track(3, "lost"))
    receiver.on_tracks(sample(Tracks(header=header(7), tracks=tracks)))
    receiver.on_centroid(
        sample(Centroid(header=header(7), x=5, y=10, box=(0, 0, 10, 20), area=150.0))
    )
    assert receiver.boxes == {7: {1: (0.0, 0.0, 10.0, 20.0)}}
    assert receiver.centroids == {7: (0, 0, 10, 20)}
    assert receiver.newest == 7


def test_a_second_run_of_the_video_does_not_count():
    receiver = Receiver()
    for epoch in (5, 6):
        moving = (track(epoch, "confirmed"),)
        receiver.on_tracks(sample(Tracks(header=header(0, epoch), tracks=moving)))
        receiver.on_centroid(
            sample(Centroid(header=header(1, epoch), x=None, y=None, box=None, area=None))
        )
    assert set(receiver.boxes[0]) == {5}
    assert receiver.centroids == {1: None}
