"""Pictures of a camera that shakes are moved back to where the background is."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.foreground import (
    ForegroundDetector,
    ForegroundParameters,
    SceneLimits,
)
from zv.tracker.foreground.steadying import (
    Steadier,
    SteadyLimits,
    clear_unseen,
    moved_back,
    reduced,
)
from zv.tracker.pipelines.base import enlarged
from zv.tracker.pipelines.robust import RobustTracker
from zv.tracker.tracking.region import Region

SIZE = 360, 240  # width, height
MARGIN = 20


def wide_scene(seed: int = 5) -> np.ndarray:
    """Return (280, 400, 3): the scene with a margin of 20 pixels that comes into view."""
    rng = np.random.default_rng(seed)
    coarse = rng.uniform(40, 200, (28, 40, 3)).astype(np.float32)
    fine = rng.normal(0, 8, (280, 400, 1))
    return np.clip(cv2.resize(coarse, (400, 280)) + fine, 0, 255).astype(np.uint8)


def seen(scene: np.ndarray, x: int = 0, y: int = 0) -> np.ndarray:
    """Return the part in view; what is in it is moved by x and y pixels."""
    rows = slice(MARGIN - y, MARGIN - y + SIZE[1])
    return scene[rows, MARGIN - x : MARGIN - x + SIZE[0]].copy()


def moved(background: np.ndarray, picture: np.ndarray) -> tuple[int, int]:
    return Steadier(SteadyLimits()).moved(background, reduced(picture))


@pytest.mark.parametrize("by", [(0, 0), (3, 0), (0, -4), (-5, 6), (9, 8)])
def test_the_motion_of_the_camera_is_measured_to_a_pixel(by: tuple[int, int]):
    scene = wide_scene()
    found = moved(seen(scene), seen(scene, *by))
    assert np.abs(np.subtract(found, by)).max() <= (1 if any(by) else 0)


def test_an_object_that_passes_before_a_camera_that_stands_moves_nothing():
    scene = seen(wide_scene())
    for x in range(0, 280, 20):
        picture = scene.copy()
        picture[40:200, x : x + 80] = (20, 20, 220)
        assert moved(scene, picture) == (0, 0)


def test_the_motion_is_measured_beside_an_object_before_a_third_of_the_scene():
    ramp = np.linspace(0, 120, 400)[None, :, None]  # so that a bright object seems to move it
    scene = (wide_scene() / 2 + ramp).astype(np.uint8)
    for x in range(0, 240, 40):
        picture = seen(scene, 6, -4)
        picture[:, x : x + 120] = 255
        assert np.abs(np.subtract(moved(seen(scene), picture), (6, -4))).max() <= 1


def test_a_belt_with_a_texture_that_moves_past_its_frame_is_not_moved_back():
    still, belt = seen(wide_scene()), wide_scene(6)
    still[60:180] = 90 + belt[60:180, :360] // 12
    for step in range(3, 40, 4):
        picture = still.copy()
        picture[60:180] = 90 + belt[60:180, step : step + 360] // 12
        assert moved(still, picture) == (0, 0)


def test_what_is_too_far_is_another_view_and_not_moved_back():
    scene = wide_scene()
    assert moved(seen(scene), seen(scene, 14, 0)) == (0, 0)  # more than 5 % of 240
    assert moved(seen(scene), seen(wide_scene(8))) == (0, 0)


def test_a_plain_picture_is_not_moved():
    plain = np.full((240, 360, 3), 90, np.uint8)
    assert moved(plain, plain + np.uint8(20)) == (0, 0)
    tiny = np.full((5, 5, 3), 90, np.uint8)
    assert moved(tiny, tiny) == (0, 0)


@pytest.mark.parametrize("by", [(3, 5), (-3, 5), (3, -5), (-3, -5), (0, 4), (-4, 0)])
def test_only_what_was_not_in_the_picture_is_cleared(by: tuple[int, int]):
    scene = wide_scene()
    still, picture = seen(scene), seen(scene, *by)
    mask = np.full(SIZE[::-1], 255, np.uint8)
    clear_unseen(mask, by)
    assert (moved_back(picture, by)[mask > 0] == still[mask > 0]).all()
    assert np.count_nonzero(mask) == (SIZE[0] - abs(by[0])) * (SIZE[1] - abs(by[1]))


def test_the_strip_that_a_moved_camera_does_not_show_is_not_learned():
    stays_moved = ForegroundParameters(scene=SceneLimits(stays_s=np.inf))
    scene, found = wide_scene(), ForegroundDetector(stays_moved)
    for k in range(300):
        picture = seen(scene) if k < 60 else seen(scene, 10, -10)
        found.update(found.steadied(picture), k / 10, [])
    assert found.moved == pytest.approx((10, -10), abs=1)
    mask, _, shown = found.update(found.steadied(seen(scene)), 30.0, [])
    assert (shown, np.count_nonzero(mask)) == ("scene", 0)


def test_another_view_is_learned_as_the_camera_shows_it():
    scene, found = wide_scene(), ForegroundDetector(ForegroundParameters())
    other = scene.copy()
    other[:, 130:] = wide_scene(9)[:, 130:]
    for k in range(120):
        picture = seen(scene) if k < 50 else seen(scene if k < 80 else other, 5, 0)
        _, _, shown = found.update(found.steadied(picture), k / 10, [])
        assert found.moved == ((0, 0) if k < 50 or k >= 84 else (5, 0)), k
        assert (shown == "other") == (k == 84)


def test_another_view_is_said_for_as_long_as_nothing_may_be_learned_of_it():
    found = ForegroundDetector(ForegroundParameters())
    said = []
    for k in range(120):
        found.parameters = ForegroundParameters(frozen=k >= 50)
        picture = seen(wide_scene(9 if 60 <= k < 90 else 5))
        said.append(found.update(found.steadied(picture), k / 10, [])[2])
    assert said == ["scene"] * 64 + ["other"] * 26 + ["scene"] * 30


def test_a_camera_that_was_pushed_for_good_sees_all_of_its_picture_again():
    scene, found = wide_scene(), ForegroundDetector(ForegroundParameters())
    others = []
    for k in range(220):
        picture = seen(scene) if k < 50 else seen(scene, 8, -7)
        _, _, shown = found.update(found.steadied(picture), k / 10, [])
        others += [k] * (shown == "other")
    assert others == [151]  # more than 10 s after it was pushed
    assert found.moved == (0, 0)
    picture[100:140, :12] = (20, 20, 230)  # at the left border, which was not in the old view
    mask, _, _ = found.update(found.steadied(picture), 22.0, [])
    x, y, width, height = cv2.boundingRect(mask)
    assert (x, y, width, height) == pytest.approx((0, 100, 12, 40), abs=1)


@pytest.mark.parametrize(("by", "known"), [((8, -7), True), ((2, 1), False), (None, False)])
def test_its_view_is_not_learned_with_objects_a_smaller_push_or_while_it_shakes(
    by: tuple[int, int] | None, known: bool
):
    rng = np.random.default_rng(3)
    scene, found = wide_scene(), ForegroundDetector(ForegroundParameters())
    box = Region(150, 100, 170, 140, 800)
    for k in range(300):
        x, y = (0, 0) if k < 50 else by or rng.integers(-8, 9, 2).tolist()
        shown = found.update(found.steadied(seen(scene, x, y)), k / 10, [box] if known else [])[2]
        assert shown == "scene", k


def test_a_mask_is_shown_where_its_frame_shows_it():
    mask = np.zeros((20, 30), np.uint8)
    mask[5:10, 6:12] = 255
    shown = enlarged(mask, (60, 40), (4, -3))
    assert cv2.boundingRect(shown) == (20, 4, 12, 10)


def test_a_walker_before_a_camera_that_shakes_is_the_only_track_and_where_the_frame_shows_it():
    rng, scene, robust = np.random.default_rng(7), wide_scene(), RobustTracker()
    for k in range(80):
        there = scene.copy()
        left = MARGIN + 10 + 4 * (k - 20)
        if k >= 20:
            there[120:180, left : left + 24] = (30, 20, 230)
        x, y = (0, 0) if k < 5 else rng.integers(-6, 7, 2).tolist()
        tracks = robust.update(seen(there, x, y), k * 100_000_000)
        assert len(tracks) <= 1, k
        if k >= 40:
            (track,) = tracks
            box = left - MARGIN + x, 120 - MARGIN + y, 24, 60
            assert track.state == "confirmed"
            assert track.box == pytest.approx(box, abs=3)
            assert (track.x, track.y) == pytest.approx((box[0] + 12, box[1] + 30), abs=3)
            assert track.steady is not None
            centre = np.add(track.steady, track.offset)
            assert centre == pytest.approx((track.x, track.y), abs=3)
