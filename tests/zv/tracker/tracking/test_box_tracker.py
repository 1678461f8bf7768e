"""Tracks of a model's boxes: confirmation, classes, late results, motion between its runs."""

from __future__ import annotations

import pytest

from zv.tracker.tracking.box_association import BoxLimits, ScoredBox, match_boxes
from zv.tracker.tracking.box_tracker import BoxTracker
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import BoxState

SIZE = (640, 480)
STEP_S = 0.1


def region(x: float, y: float = 100, width: float = 40, height: float = 80) -> Region:
    return Region(x, y, x + width, y + height, width * height)


def box(x: float, score: float = 0.6, name: str = "person", y: float = 100) -> ScoredBox:
    return ScoredBox(region(x, y), score, name, 0.5)


def matched(found: list[ScoredBox]) -> tuple[list[tuple[int, int]], list[int]]:
    """Return which boxes belong to a person at 100, who moves along x, and which are new."""
    track = BoxState.new(1, region(100), 0.0)
    track.x.pp, track.y.pp = 64.0, 4.0
    track.confirmed, track.class_name = True, "person"
    return match_boxes([track], [track.box], found, BoxLimits())


class Film:
    """A tracker, and the number of the next picture."""

    def __init__(self) -> None:
        self.tracker = BoxTracker(SIZE)
        self.index = 0

    def show(self, *found: ScoredBox):
        self.tracker.predict(self.index * STEP_S)
        self.index += 1
        self.tracker.see(found)
        return self.tracker.finish()

    def move(self, *regions: Region):
        self.tracker.predict(self.index * STEP_S)
        self.index += 1
        self.tracker.move(regions)
        return self.tracker.finish()


def test_a_track_is_confirmed_when_the_model_was_sure_of_it_three_times():
    film = Film()
    states = [film.show(box(100 + 4 * step))[0].state for step in range(4)]
    assert states == ["tentative", "tentative", "confirmed", "confirmed"]


def test_a_clear_object_is_confirmed_when_it_was_found_twice():
    film = Film()
    assert [film.show(box(100, 0.9))[0].state for _ in range(2)] == ["tentative", "confirmed"]


def test_a_box_that_is_not_sure_begins_no_track_but_continues_one():
    film = Film()
    assert film.show(box(100, 0.3)) == []
    for step in range(3):
        film.show(box(100 + 4 * step))
    [track] = film.show(box(112, 0.3))
    assert (track.state, track.missing_s, track.score) == ("confirmed", 0.0, 0.3)


def test_the_class_is_that_with_the_most_evidence():
    film = Film()
    names = ["car", "car", "truck", "car", "truck", "car"]
    tracks = [film.show(box(100, 0.7, name))[0] for name in names]
    assert {track.id for track in tracks} == {1}
    assert [track.class_name for track in tracks[1:]] == ["car"] * 5


def test_two_objects_that_pass_each_other_keep_their_ids():
    film = Film()
    for step in range(20):
        left, right = 100 + 10 * step, 300 - 10 * step
        tracks = film.show(box(left), box(right, y=130))
    assert {track.id: round(track.box[0], -1) for track in tracks} == {1: 290, 2: 110}


def test_a_track_that_is_not_found_is_lost_then_ended_and_comes_back_under_its_id():
    film = Film()
    for _ in range(6):
        film.show(box(100))
    states = [film.show()[0].state for _ in range(6)]
    # Followed for 0.5 s, so it is shown for half of that without being found, then it is lost.
    assert states == ["confirmed"] * 2 + ["lost"] * 4
    assert [(track.id, track.state) for track in film.show(box(100))] == [(1, "confirmed")]
    for _ in range(22):
        tracks = film.show()
    assert tracks == []


def test_at_the_border_a_track_is_lost_at_once_but_keeps_its_id_for_a_second():
    film = Film()
    feet = box(100, y=400)  # 80 high, to the last row
    for _ in range(6):
        film.show(feet)
    states = [film.show()[0].state for _ in range(9)]
    assert states == ["lost"] * 9
    assert [(track.id, track.state) for track in film.show(feet)] == [(1, "confirmed")]
    for _ in range(11):
        tracks = film.show()
    assert tracks == []


@pytest.mark.parametrize(("followed", "kept"), [(3, 10), (15, 14), (40, 20)])
def test_a_track_that_is_lost_is_kept_no_longer_than_it_was_followed(followed: int, kept: int):
    """Where it is now is known the less, the shorter it was seen; another may appear there."""
    film = Film()
    for _ in range(followed):
        film.show(box(100, 0.9))
    lengths = [len(film.show()) for _ in range(30)]
    assert sum(lengths) == pytest.approx(kept, abs=1)  # frames of 0.1 s


def test_a_slow_model_may_miss_a_new_track_once():
    tracker = BoxTracker(SIZE)
    lengths = []
    for second, found in enumerate([[box(100, 0.9)], [box(100, 0.9)], [], [], []]):
        tracker.predict(second)
        tracker.see(found)
        lengths.append(len(tracker.finish()))
    assert lengths == [1, 1, 1, 0, 0]


def test_sure_boxes_are_assigned_before_others_and_duplicates_begin_nothing():
    found = [box(102, 0.3), box(110, 0.9), box(112, 0.8)]
    assert matched(found) == ([(0, 1)], [])


def test_what_moved_farther_than_its_width_is_found_by_its_distance_if_the_class_is_the_same():
    assert matched([box(142)]) == ([(0, 0)], [])
    assert matched([box(142, name="dog")]) == ([], [0])


def test_between_runs_of_the_model_a_track_moves_with_its_region_of_motion():
    film = Film()
    for step in range(5):
        film.tracker.predict(film.index * STEP_S)
        film.tracker.see([box(100 + 2 * step)])
        film.tracker.move([region(95 + 2 * step, 90, 50, 95)], seen=False)
        film.tracker.finish()
        film.index += 1
    for step in range(5, 10):
        [track] = film.move(region(95 + 8 * (step - 4) + 8, 90, 50, 95))
    # The last region is 40 pixels right of the one of the last run, at which the box was at 108.
    assert track.box[0] == pytest.approx(148, abs=4)
    assert (track.state, track.missing_s, track.box[2:]) == ("confirmed", 0.0, (40, 80))


def test_between_runs_an_object_that_stands_still_stays_and_motion_alone_begins_nothing():
    film = Film()
    for _ in range(4):
        film.show(box(100))
    for _ in range(50):
        tracks = film.move(region(400))
    assert [(each.id, each.state, each.box[0]) for each in tracks] == [(1, "confirmed", 100)]


def test_a_late_result_is_moved_as_its_track_has_moved_since():
    """The box of an earlier frame must not appear at its old place."""
    film = Film()
    for step in range(10):
        film.show(box(100 + 10 * step))
    at_s = (film.index - 1) * STEP_S
    for step in range(10, 14):
        film.move(region(100 + 10 * step))
    before = film.tracker.states[0].x.position
    assert film.tracker.see_late([box(190, 0.7, "dog")], at_s)
    assert film.tracker.states[0].x.position == pytest.approx(before, abs=2)
    assert film.tracker.states[0].missed == 0


def test_a_result_for_a_frame_that_is_long_past_changes_nothing():
    film = Film()
    for _ in range(5):
        film.show(box(100))
    for _ in range(30):
        film.move()
    assert not film.tracker.see_late([box(300)], 0.0)
    assert len(film.tracker.states) == 1


def test_an_object_that_began_after_the_frame_of_a_late_result_is_not_missed_in_it():
    film = Film()
    film.show()
    for _ in range(4):
        film.show(box(100))
    assert film.tracker.see_late([], 0.0)
    assert film.tracker.states[0].missed == 0
