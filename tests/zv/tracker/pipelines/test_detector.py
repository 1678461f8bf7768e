"""The pipeline of models on the pictures of one camera: when the model runs, what is tracked."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from zv.tracker.detector.class_names import Wanted
from zv.tracker.detector.model import Detection
from zv.tracker.foreground.foreground import ForegroundDetector, ForegroundParameters
from zv.tracker.pipelines.base import working_scale
from zv.tracker.pipelines.detector import DetectorParameters, DetectorTracker

SIZE = (640, 480)
RATE_HZ = 10
SCALE = working_scale(*SIZE)
PARAMETERS = DetectorParameters(Wanted(0.5))


def thing(left: float, name: str = "car", score: float = 0.9, top: float = 100) -> Detection:
    return Detection((left, top, left + 80, top + 120), score, 0, name)


def picture(left: int | None = None) -> NDArray[np.uint8]:
    """Return a room at the reduced size, with a dark box at a column of the full size."""
    made = np.full((SIZE[1] // SCALE, SIZE[0] // SCALE, 3), 130, np.uint8)
    made[::7, ::5] = 90
    if left is not None:
        made[100 // SCALE : 220 // SCALE, left // SCALE : (left + 80) // SCALE] = (30, 40, 50)
    return made


class Film:
    """A tracker, and the number of the next frame."""

    def __init__(self, parameters: DetectorParameters = PARAMETERS) -> None:
        self.tracker = DetectorTracker(parameters)
        self.seq = 0
        self.seen: list[int] = []

    def show(self, *found: Detection, shown: NDArray[np.uint8] | None = None):
        """Return the tracks of a frame; what would be found counts only if the model sees it."""
        sees = self.tracker.begin(self.seq * 10**9 // RATE_HZ, self.seq, SIZE, shown)
        self.seen += [self.seq] * sees
        self.seq += 1
        return self.tracker.finish(found if sees else None)


def test_the_model_sees_every_frame_or_every_nth_of_the_camera():
    for every, seen in ((1, [0, 1, 2, 3, 4, 5, 6]), (3, [0, 3, 6])):
        film = Film(replace(PARAMETERS, every=every))
        for _ in range(7):
            film.show(shown=picture())
        assert film.seen == seen


def test_frames_that_were_dropped_count_for_every():
    tracker = DetectorTracker(replace(PARAMETERS, every=3))
    seen = []
    for seq in (0, 2, 4, 5, 8, 10):
        if tracker.begin(seq * 10**8, seq, SIZE, picture()):
            seen.append(seq)
        tracker.finish(None)
    assert seen == [0, 4, 8]  # at 4 and 8 it is at least three since the last


def test_on_motion_the_model_sees_the_start_then_only_what_moves():
    film = Film(replace(PARAMETERS, on_motion=True))
    for _ in range(60):
        film.show(shown=picture())
    at_rest = film.seen[-1]
    assert at_rest <= 15  # the first second, and one more
    for step in range(20):
        film.show(thing(100 + 10 * step), shown=picture(100 + 10 * step))
    assert set(range(62, 80)) <= set(film.seen)
    assert film.tracker.tracks[0].class_name == "car"


def test_an_object_that_stands_stays_while_the_model_rests():
    film = Film(replace(PARAMETERS, on_motion=True))
    for _ in range(60):
        tracks = film.show(thing(300), shown=picture(300))
    assert film.seen[-1] < 20
    assert [(track.state, track.missing_s, track.box) for track in tracks] == [
        ("confirmed", 0.0, (300, 100, 80, 120))
    ]


def test_between_runs_an_object_is_followed_by_its_motion():
    film = Film(replace(PARAMETERS, every=5))
    for _ in range(10):
        film.show(shown=picture())
    errors = []
    for step in range(40):
        left = 60 + 10 * step
        tracks = film.show(thing(left), shown=picture(left))
        if step > 16:
            [track] = [each for each in tracks if each.state == "confirmed"]
            errors.append(abs(track.box[0] - left))
    assert max(errors) <= 6  # of 10 pixels a frame; a box of the last run would be 40 behind


def test_between_runs_an_object_is_followed_where_a_camera_that_shakes_shows_it():
    rng = np.random.default_rng(3)
    coarse = rng.uniform(60, 220, (24, 32, 3)).astype(np.float32)
    room = cv2.resize(coarse, (SIZE[0] // SCALE, SIZE[1] // SCALE)).astype(np.uint8)
    film, errors = Film(replace(PARAMETERS, every=5)), []
    for step in range(60):
        right = int(rng.integers(-6, 7)) if step > 10 else 0  # pixels of the reduced size
        left = 60 + 8 * (step - 10)
        shown = room.copy()
        if step > 10:
            shown[100 // SCALE : 220 // SCALE, left // SCALE : (left + 80) // SCALE] = (10, 20, 30)
        found = [thing(left + SCALE * right)] if step > 10 else []
        tracks = film.show(*found, shown=np.roll(shown, right, axis=1))
        if step > 26:
            [track] = [each for each in tracks if each.state == "confirmed"]
            errors.append(abs(track.box[0] - left - SCALE * right))
    assert max(errors) <= 6


def test_what_a_moved_camera_shows_is_not_learned_where_the_background_is(
    monkeypatch: pytest.MonkeyPatch,
):
    subtracted, update = [], ForegroundDetector.update

    def note(self, shown, now_s, known):
        subtracted.append((self.moved, [box.left for box in known]))
        return update(self, shown, now_s, known)

    monkeypatch.setattr(ForegroundDetector, "update", note)
    rng = np.random.default_rng(3)
    coarse = rng.uniform(60, 220, (24, 32, 3)).astype(np.float32)
    room = cv2.resize(coarse, (SIZE[0] // SCALE, SIZE[1] // SCALE)).astype(np.uint8)
    film = Film(replace(PARAMETERS, every=2))
    for step in range(40):
        right = 8 if step > 10 else 0  # pixels of the reduced size
        left = 60 + 10 * step  # in the scene
        film.show(thing(left + SCALE * right), shown=np.roll(room, right, axis=1))
        if step > 20:
            moved, known = subtracted[-1]
            assert moved == pytest.approx((right, 0), abs=1)
            assert known == pytest.approx([left / SCALE], abs=4)


def test_regions_and_zones_stay_at_their_places_in_the_scene_while_the_camera_shakes():
    rng = np.random.default_rng(3)
    coarse = rng.uniform(60, 220, (24, 32, 3)).astype(np.float32)
    room = cv2.resize(coarse, (SIZE[0] // SCALE, SIZE[1] // SCALE)).astype(np.uint8)
    half = ((0, 0), (150, 0), (150, 480), (0, 480))  # the middle of what stands at 100 is at 140
    film = Film(replace(PARAMETERS, every=2, foreground=ForegroundParameters(regions=(half,))))
    for step in range(40):
        right = (0, 0, 8, 8, -7, -7)[step % 6] if step > 10 else 0  # of the reduced size
        left = 100 + SCALE * right
        film.show(thing(left), shown=np.roll(room, right, axis=1))
        if step > 14 and film.seen[-1] == step:
            [track], [still] = film.tracker.tracks, film.tracker.still
            assert (track.state, track.missing_s, still.state) == ("confirmed", 0, "confirmed")
            assert track.box[0] == pytest.approx(left, abs=4)
            assert still.box[0] == pytest.approx(100, abs=6)
    late = [thing(left + SCALE * 8, top=300) for left in (100, 130)]  # right was 8 at 38
    assert film.tracker.late(late, 38 * 10**8)
    assert sorted(track.box[1] for track in film.show(thing(100), shown=room)) == [100, 300]


def test_without_background_subtraction_nothing_is_followed_by_its_former_motion():
    film = Film(replace(PARAMETERS, every=2))
    for step in range(20):
        film.show(thing(100 + 10 * step), shown=picture(100 + 10 * step))
    tracker = film.tracker
    assert tracker.has_background
    tracker.parameters = replace(PARAMETERS, every=1)
    for seq in range(20, 24):
        tracker.begin(seq * 10**9 // RATE_HZ, seq, SIZE, None)
        [track] = tracker.finish(None)  # the model took too long
    assert not tracker.has_background
    assert track.missing_s >= 0.3


def test_the_run_for_a_frame_that_was_given_up_is_that_of_the_next_one():
    tracker = DetectorTracker(replace(PARAMETERS, every=3))
    for seq in (0, 1, 2):
        assert tracker.begin(seq * 10**8, seq, SIZE, picture())  # 0 and 1 are never finished
    tracker.finish([thing(100)])
    seen = []
    for seq in range(3, 7):
        seen += [seq] * tracker.begin(seq * 10**8, seq, SIZE, picture())
        tracker.finish(None)
    assert seen == [5]


def test_boxes_of_other_classes_regions_and_scores_are_left_out():
    square = ((0, 0), (320, 0), (320, 480), (0, 480))
    film = Film(
        replace(
            PARAMETERS,
            wanted=Wanted(0.5, {"car": None, "dog": 0.8}),
            foreground=ForegroundParameters(
                regions=(square,), ignored=(((0, 300), (320, 300), (320, 480), (0, 480)),)
            ),
        )
    )
    for _ in range(4):
        tracks = film.show(
            thing(20),
            thing(120, "person"),
            thing(120, "dog", 0.7, top=10),
            thing(400),
            thing(200, top=320),
        )
    assert [track.box[0] for track in tracks] == [20]


def test_with_the_foot_as_anchor_the_foot_of_a_box_must_be_inside():
    lower = ((0, 200), (640, 200), (640, 480), (0, 480))
    low = replace(PARAMETERS, foreground=ForegroundParameters(regions=(lower,)))
    for at_foot, count in ((False, 0), (True, 1)):  # of 100 to 220 the centre is at 160
        assert len(Film(replace(low, at_foot=at_foot)).show(thing(20))) == count


def test_a_late_result_is_used_and_one_of_an_unknown_frame_is_not():
    film = Film(replace(PARAMETERS, every=0))
    for _ in range(3):
        film.show(thing(100), shown=picture())
    assert film.tracker.late([thing(100), thing(400)], 2 * 10**8)
    assert not film.tracker.late([thing(100)], 77)
    tracks = film.show(thing(100), thing(400), shown=picture())
    assert sorted(track.box[0] for track in tracks) == [100, 400]


def test_ids_continue_after_all_tracks_ended_and_other_sizes_begin_anew():
    film = Film()
    film.show(thing(100))
    film.tracker.end_tracks()
    assert film.tracker.tracks == []
    assert [track.id for track in film.show(thing(100))] == [2]
    film.tracker.begin(10**9, 9, (320, 240), None)
    assert film.tracker.finish([thing(10)])[0].id == 3


def test_without_motion_no_background_is_offered():
    film = Film()
    film.show(thing(100))
    assert not film.tracker.has_background
    with pytest.raises(ValueError, match="no background"):
        film.tracker.background()
    film = Film(replace(PARAMETERS, on_motion=True))
    film.show(shown=picture())
    assert film.tracker.background().shape == (SIZE[1], SIZE[0], 3)


def test_the_main_object_is_the_largest_confirmed_one():
    film = Film()
    for _ in range(3):
        film.show(thing(100), Detection((300, 50, 500, 400), 0.9, 0, "bus"))
    assert film.tracker.centroid is not None
    assert film.tracker.centroid.class_name == "bus"
