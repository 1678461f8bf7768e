"""The truth of the synthetic scenes is what their pictures show."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.quality.tracker.room import Room
from benchmarks.quality.tracker.scenarios import SCENARIOS, crossing, returning
from benchmarks.quality.tracker.scenes import HEIGHT, WIDTH, Actor, Scene, cut, visible
from zv.camera.synthetic.scene import Scene as SyntheticScene

STANDS = Actor(1, (((0.0, 100.0, 200.0), (1.0, 110.0, 200.0)),), size=(30, 80))


def test_an_object_is_drawn_where_its_box_is():
    scene = Scene("one", 1.0, (STANDS,))
    empty = Scene("none", 1.0, ())
    for time_s in (0.0, 0.5):
        shown = np.abs(scene.picture(time_s).astype(int) - empty.picture(time_s)).max(axis=2)
        found = cv2.boundingRect((shown > 12).astype(np.uint8))
        truth, ignored = scene.truth(time_s)
        # The foot is at x = 100 + 10 t: the box begins 15 to its left and 80 above.
        assert truth == {1: (85 + 10 * time_s, 120, 30, 80)}
        assert ignored == []
        assert found == pytest.approx(truth[1], abs=1)


def test_an_object_moves_between_its_waypoints_and_is_absent_outside_its_visits():
    actor = Actor(1, (((1.0, 0.0, 10.0), (2.0, 50.0, 20.0)), ((4.0, 9.0, 9.0), (5.0, 9.0, 9.0))))
    assert actor.foot(1.5) == (25.0, 15.0)
    assert [actor.foot(time_s) is None for time_s in (0.9, 2.5, 4.5, 5.1)] == [
        True,
        True,
        False,
        True,
    ]


def test_a_box_is_cut_at_the_border_and_ignored_when_less_than_half_is_inside():
    assert cut((-10.0, 0.0, 30.0, 80.0)) == (0.0, 0.0, 20.0, 80.0)
    assert cut((float(WIDTH), 0.0, 30.0, 80.0)) is None
    scene = Scene("border", 1.0, (Actor(1, (((0.0, 2.0, 200.0), (1.0, -8.0, 200.0)),), (30, 80)),))
    assert scene.truth(0.0) == ({1: (0.0, 120.0, 17.0, 80.0)}, [])
    assert scene.truth(1.0) == ({}, [(0.0, 120.0, 7.0, 80.0)])


def test_the_visible_share_takes_what_hides_into_account():
    box = (100.0, 100.0, 20.0, 40.0)
    assert visible(box, box, []) == 1.0
    assert visible(box, box, [(90.0, 90.0, 20.0, 100.0)]) == 0.5  # the left half
    assert visible(box, box, [(90.0, 90.0, 20.0, 100.0), (100.0, 130.0, 50.0, 50.0)]) == 0.375


def test_the_nearer_object_hides_the_other_which_is_then_ignored():
    scene = crossing()
    # At 5.5 s actors 1 and 2 are both in the middle; 2 has the lower foot, so it is in front.
    truth, ignored = scene.truth(5.5)
    assert set(truth) == {2}
    assert len(ignored) == 1
    truth, ignored = scene.truth(4.0)
    assert set(truth) == {1, 2}


def test_the_pillar_hides_whoever_passes():
    scene = returning()
    assert scene.pillar is not None
    x, y, width, _ = scene.pillar
    # Actor 3 walks 690 pixels, from -25, between 17 and 24 s.
    time_s = 17 + 7 * (x + width / 2 + 25) / 690
    assert 3 not in scene.truth(time_s)[0]
    assert (
        scene.picture(time_s)[y + 5 : y + 100, x : x + width]
        == scene.picture(0.0)[y + 5 : y + 100, x : x + width]
    ).all()


def test_light_brightens_the_whole_picture():
    scene = Scene("light", 1.0, (STANDS,), light=lambda time_s: 1.0 if time_s < 0.5 else 1.4)
    ratio = scene.picture(0.5).mean() / Scene("dark", 1.0, (STANDS,)).picture(0.5).mean()
    assert ratio == pytest.approx(1.4, abs=0.01)


PLAYED = [make for make in SCENARIOS if isinstance(make(), Scene)]


@pytest.mark.parametrize("make", PLAYED, ids=lambda make: make.__name__)
def test_a_scene_begins_empty_and_all_its_objects_leave(make):
    scene = make()
    assert scene.truth(0.0) == ({}, [])
    assert scene.truth(scene.duration_s - 0.5) == ({}, [])
    seen = set()
    for tenth in range(int(scene.duration_s * 10)):
        truth, _ = scene.truth(tenth / 10)
        seen |= set(truth)
        for x, y, width, height in truth.values():
            assert min(x, y) >= 0
            assert (x + width, y + height) <= (WIDTH, HEIGHT)
            assert y + height <= HEIGHT
    assert seen == {actor.id for actor in scene.actors}


def test_stamps_follow_the_rate_and_pictures_repeat():
    scene = Scene("one", 1.0, (STANDS,))
    shots = list(scene.shots(5.0)())
    assert [shot.stamp_ns - shots[0].stamp_ns for shot in shots[:3]] == [
        0,
        200_000_000,
        400_000_000,
    ]
    assert (next(scene.shots(5.0)()).bgr == shots[0].bgr).all()


def test_the_room_has_each_visible_object_either_in_its_truth_or_ignored():
    room = Room(duration_s=10.0)
    shots = list(room.shots(1.0)())
    scene = SyntheticScene(WIDTH, HEIGHT, 1.0, room.seed)
    for shot in shots:
        present = {one.id: one.box for one in scene.truth(shot.index)}
        assert shot.truth.items() <= present.items()
        assert len(shot.truth) + len(shot.ignored) == len(present)
    assert any(shot.ignored for shot in shots)
    assert any(len(shot.truth) > 1 for shot in shots)
