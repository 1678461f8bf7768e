"""The foreground of a fixed camera, on painted scenes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.background import BackgroundModel
from zv.tracker.foreground.foreground import ForegroundDetector, ForegroundParameters
from zv.tracker.foreground.fragments import fragments_of
from zv.tracker.foreground.ghosts import GhostFinder, picture_share
from zv.tracker.foreground.lighting import relit, same_texture
from zv.tracker.foreground.regions import region_mask
from zv.tracker.tracking.fragment import Fragment

TENTH = 100_000_000


def backdrop() -> np.ndarray:
    """Return (120, 160, 3) with texture, between 60 and 150."""
    coarse = np.random.default_rng(2).uniform(60, 150, (15, 20, 3)).astype(np.float32)
    return cv2.resize(coarse, (160, 120)).astype(np.uint8)


def learned(**changes: object) -> ForegroundDetector:
    """Return a detector that has seen 6 s of the empty scene."""
    found = ForegroundDetector(ForegroundParameters(**changes))  # type: ignore[arg-type]
    for k in range(60):
        found.update(backdrop(), k * TENTH, [])
    return found


def with_object(x: int = 60) -> np.ndarray:
    picture = backdrop()
    picture[40:80, x : x + 20] = (30, 30, 220)
    return picture


@pytest.mark.parametrize("subtractor", ["mog2", "knn"])
def test_exactly_the_object_is_foreground(subtractor: str):
    mask, changed = learned(subtractor=subtractor).update(with_object(), 60 * TENTH, [])
    expected = np.zeros_like(mask)
    expected[40:80, 60:80] = 255
    assert np.count_nonzero(mask != expected) <= 8  # the corners, by the median
    assert not changed


def test_nothing_is_foreground_in_the_first_second():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(10):
        mask, _ = found.update(with_object(10 + 10 * k), k * TENTH, [])
        assert not mask.any()


def test_a_person_who_walks_away_in_the_first_seconds_leaves_no_ghost():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(40):
        mask, _ = found.update(with_object(min(135, 5 + 6 * k)), k * TENTH, [])
    assert not mask[:, :100].any()


def test_a_standing_object_stays_foreground_if_known_and_becomes_background_if_not():
    known = [Fragment(60, 40, 80, 80, 800)]
    kept, melted = learned(learning_s=2.0), learned(learning_s=2.0)
    for k in range(60, 460):
        stays, _ = kept.update(with_object(), k * TENTH, known)
        gone, _ = melted.update(with_object(), k * TENTH, [])
    assert np.count_nonzero(stays) > 700
    assert not gone.any()
    after, _ = kept.update(backdrop(), 460 * TENTH, [])
    assert not after.any()


def test_nothing_is_learned_while_frozen():
    found = learned(frozen=True, learning_s=0.5)
    for k in range(60, 200):
        mask, _ = found.update(with_object(), k * TENTH, [])
    assert np.count_nonzero(mask) > 700


def test_changes_counted_before_freezing_say_nothing_while_frozen():
    found = learned()
    assert found.changes is not None
    found.adjust(ForegroundParameters(frozen=True))
    found.update(backdrop(), 70 * TENTH, [])
    assert found.changes is None


@pytest.mark.parametrize("gain", [1.5, 0.7])
def test_an_object_stays_foreground_through_a_change_of_the_light(gain: float):
    found = learned()
    found.update(with_object(), 60 * TENTH, [])
    other = np.clip(with_object() * gain, 0, 255).astype(np.uint8)
    changes = 0
    for k in range(61, 71):
        mask, changed = found.update(other, k * TENTH, [Fragment(60, 40, 80, 80, 800)])
        changes += changed
    assert changes == 1
    assert np.count_nonzero(mask[40:80, 60:80]) > 600
    assert np.count_nonzero(mask) < 900


def test_a_cloud_that_comes_within_a_second_is_one_change():
    found = learned()
    changes = 0
    for k in range(25):
        darker = (backdrop() * max(0.6, 1 - 0.04 * k)).astype(np.uint8)
        mask, changed = found.update(darker, (60 + k) * TENTH, [])
        changes += changed
        assert not mask.any()
    assert changes == 1


def test_a_changed_view_is_learned_anew_within_a_second():
    found = learned()
    other = backdrop()[::-1, ::-1].copy()
    other[:60] = 255 - other[:60]
    said = [found.update(other, k * TENTH, [])[1] for k in range(60, 75)]
    assert sum(said) == 1
    assert said.index(True) < 10
    assert not found.update(other, 80 * TENTH, [])[0].any()


def test_objects_are_detected_inside_regions_and_not_inside_ignored_ones():
    # In full-resolution pixels; the mask is half as large.
    region = ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0))
    ignored = ((20.0, 0.0), (40.0, 0.0), (40.0, 40.0), (20.0, 40.0))
    mask = region_mask((40, 30), 2, [region], [ignored])
    assert mask is not None
    assert mask[10, 5] == 255
    assert (mask[10, 15], mask[10, 30], mask[25, 5]) == (0, 0, 0)
    assert region_mask((40, 30), 2, [], []) is None


def test_a_shadow_is_left_out():
    shadow = backdrop()
    shadow[40:80, 60:80] = (shadow[40:80, 60:80] * 0.75).astype(np.uint8)
    assert not learned().update(shadow, 60 * TENTH, [])[0].any()
    found = learned(detect_shadows=False)
    assert found.update(shadow, 60 * TENTH, [])[0].any()


def test_the_outline_of_a_ghost_is_an_edge_in_the_background_even_if_faint():
    mask = np.zeros((120, 160), np.uint8)
    mask[40:80, 60:80] = 255
    box = Fragment(60, 40, 80, 80, 800)
    faint = cv2.addWeighted(backdrop(), 0.9, with_object(), 0.1, 0)
    for remembered in (with_object(), np.asarray(faint, np.uint8)):
        assert picture_share(backdrop(), remembered, mask, mask, box) < 0.1
        assert picture_share(remembered, backdrop(), mask, mask, box) > 0.9
    surrounded = cv2.dilate(mask, np.ones((15, 15), np.uint8))
    assert picture_share(backdrop(), with_object(), np.asarray(surrounded), mask, box) == 1


def test_a_ghost_is_found_beside_its_object_and_a_standing_object_is_not_a_ghost():
    model, finder = BackgroundModel(), GhostFinder()
    model.start(with_object(60), 0)
    found: list[int] = []
    for k in range(12):
        picture = with_object(min(20, 4 * k))  # it stood there before, and now walks and stands
        mask = model.foreground(picture)
        mask[50:54, 40:60] = 255  # so that both are one region
        now_ns = k * TENTH
        ghosts = finder.update(picture, model, mask, None, now_ns) if finder.due(now_ns) else None
        if ghosts is not None:
            found.append(k)
            assert np.count_nonzero(ghosts[40:80, 60:80]) > 780
            assert not ghosts[:, :36].any()
    assert found == [9]  # the fourth test, one each 0.3 s


def test_an_object_in_the_angle_of_a_ghost_is_not_part_of_it():
    remembered, picture = backdrop(), backdrop()
    ghost = np.zeros(remembered.shape[:2], bool)
    ghost[20:100, 20:32] = ghost[88:100, 20:110] = True  # an L, which has left
    remembered[ghost] = (30, 30, 220)
    picture[50:66, 56:72] = (220, 60, 30)  # an object that stands in its angle
    model, finder = BackgroundModel(), GhostFinder()
    model.start(remembered, 0)
    for k in range(4):
        found = finder.update(picture, model, model.foreground(picture), None, 3 * k * TENTH)
    assert found is not None
    assert np.count_nonzero(found[ghost]) > 0.95 * np.count_nonzero(ghost)
    assert not found[48:68, 54:74].any()


def test_a_ghost_in_the_hole_of_another_one_is_found_at_the_same_time():
    remembered, picture = backdrop(), backdrop()
    outer, inner = np.zeros((2, *remembered.shape[:2]), bool)
    outer[15:105, 30:120] = True
    outer[30:90, 45:105] = False
    inner[48:72, 63:87] = True
    remembered[outer | inner] = (30, 30, 220)
    model, finder = BackgroundModel(), GhostFinder()
    model.start(remembered, 0)
    for k in range(4):
        found = finder.update(picture, model, model.foreground(picture), None, 3 * k * TENTH)
        if found is not None:
            break
    assert found is not None
    for ghost in (outer, inner):
        assert np.count_nonzero(found[ghost]) > 0.95 * np.count_nonzero(ghost)


def test_the_ghost_of_a_person_present_at_the_start_disappears_within_a_second():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(60):
        mask, _ = found.update(with_object(60 if k < 28 else 100), k * TENTH, [])
        if k >= 40:
            assert not mask[:, :95].any()
            assert np.count_nonzero(mask[40:80, 100:120]) > 700


def test_a_ghost_tracked_as_an_object_disappears_within_3_s():
    found, box = ForegroundDetector(ForegroundParameters()), Fragment(60, 40, 80, 80, 800)
    for k in range(60):
        found.update(with_object(60), k * TENTH, [])
    for k in range(60, 90):
        mask, _ = found.update(backdrop(), k * TENTH, [box])
        assert mask.any() or k > 62
    assert not mask.any()


def test_the_background_learned_with_less_contrast_is_corrected_though_an_object_is_known_there():
    paler, patch = backdrop(), np.s_[40:80, 60:80]
    paler[patch] = 105 + (paler[patch].astype(float) - 105) * 0.5
    found = ForegroundDetector(ForegroundParameters())
    for k in range(60):
        found.update(paler, k * TENTH, [])
    for k in range(60, 90):
        mask, _ = found.update(backdrop(), k * TENTH, [Fragment(60, 40, 80, 80, 800)])
        assert mask.any() or k > 62
    assert not mask.any()


def test_a_ghost_is_found_where_the_background_has_an_edge_of_its_own():
    stone, shaded = backdrop(), backdrop()
    stone[40:80, 60:80] += 9
    shaded[40:80, 60:80] -= 13  # so of the step in the difference 0.4 is the picture's
    found = ForegroundDetector(ForegroundParameters(detect_shadows=False))
    for k in range(60):
        found.update(shaded, k * TENTH, [])
    for k in range(60, 90):
        mask, _ = found.update(stone, k * TENTH, [Fragment(60, 40, 80, 80, 800)])
        assert mask.any() or k > 62
    assert not mask.any()


def test_a_person_who_stops_walking_in_the_first_seconds_is_not_learned():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(60):
        x = min(60, 4 * k)
        known = [Fragment(x, 40, x + 20, 80, 800)] if k > 12 else []
        mask, _ = found.update(with_object(x), k * TENTH, known)
    assert np.count_nonzero(mask[40:80, 60:80]) > 700
    assert np.abs(found.background.picture().astype(int) - backdrop()).max() < 8


def test_a_background_is_relit_like_the_picture():
    brighter = np.clip(backdrop() * 1.4, 0, 255).astype(np.uint8)
    difference = np.abs(relit(backdrop(), brighter, None).astype(int) - brighter)
    assert difference.mean() < 2
    everywhere = np.full((120, 160), 255, np.uint8)
    assert same_texture(backdrop(), brighter, everywhere) > 0.95
    assert same_texture(backdrop(), backdrop()[::-1].copy(), everywhere) < 0.5


def test_two_people_side_by_side_are_two_fragments_and_a_block_is_one():
    mask = np.zeros((100, 200), np.uint8)
    mask[20:80, 20:42] = 255
    mask[20:80, 50:72] = 255
    mask[45:60, 42:50] = 255  # an arm
    mask[10:90, 120:180] = 255
    found = sorted(fragments_of(mask, 10, 1e9), key=lambda each: each.left)
    assert [(f.left, f.right) for f in found[1:]] == [(pytest.approx(46, abs=5), 72), (120, 180)]
    assert sum(f.area for f in found) == np.count_nonzero(mask)


def test_fragments_outside_the_limits_of_the_area_are_left_out():
    mask = np.zeros((100, 200), np.uint8)
    mask[10:14, 10:14] = mask[30:50, 30:50] = mask[10:90, 100:180] = 255
    assert [f.area for f in fragments_of(mask, 100, 1000)] == [400]


def test_a_tape_that_touches_an_object_is_not_part_of_it():
    mask = np.zeros((100, 200), np.uint8)
    mask[20:70, 100:120] = mask[30:32, 40:180] = 255
    assert [(f.left, f.right) for f in fragments_of(mask, 10, 1e9)] == [(100, 120)]


def test_another_threshold_applies_at_once():
    found = learned()
    assert found.update(with_object(), 60 * TENTH, [])[0].any()
    found.adjust(ForegroundParameters(var_threshold=10_000))
    assert not found.update(with_object(), 61 * TENTH, [])[0].any()
    found.adjust(ForegroundParameters(var_threshold=25))
    assert found.update(with_object(), 62 * TENTH, [])[0].any()


def test_a_thin_line_is_not_a_fragment():
    mask = np.zeros((100, 200), np.uint8)
    mask[10:12, 10:150] = mask[50:90, 50] = 255
    mask[30:50, 170:175] = 255
    assert [(f.left, f.right) for f in fragments_of(mask, 10, 1e9)] == [(170, 175)]


def test_the_limit_of_a_pixel_follows_its_noise():
    found, rng = ForegroundDetector(ForegroundParameters(learning_s=5.0)), np.random.default_rng(3)
    for k in range(100):
        noise = np.zeros((120, 160, 3))
        noise[:, 80:] = rng.normal(0, 5, (120, 80, 3))
        noisy = np.clip(backdrop() + noise, 0, 255).astype(np.uint8)
        mask, _ = found.update(noisy, k * TENTH, [])
        assert not mask.any()
    lighter = noisy.astype(int)
    lighter[50:70, 20:40] += 12
    lighter[50:70, 110:130] += 12
    mask, _ = found.update(np.clip(lighter, 0, 255).astype(np.uint8), 100 * TENTH, [])
    assert np.count_nonzero(mask[:, :80]) > 380  # beyond the noise of this half
    assert np.count_nonzero(mask[:, 80:]) < 40


def test_a_known_object_of_nearly_the_colour_of_the_background_is_not_learned_as_noise():
    found = learned()
    pale = backdrop()
    pale[40:80, 60:80] += 9
    for k in range(60, 160):
        mask, _ = found.update(pale, k * TENTH, [Fragment(62, 42, 78, 78, 600)])
    assert np.count_nonzero(mask[40:80, 60:80]) > 700  # also beside the box, which is too small
