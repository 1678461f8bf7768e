"""The foreground of a fixed camera, on painted scenes."""

from __future__ import annotations

import inspect
from dataclasses import replace

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.background import Background, BackgroundLimits
from zv.tracker.foreground.foreground import (
    ForegroundDetector,
    ForegroundParameters,
    SceneLimits,
)
from zv.tracker.foreground.light import LightLimits
from zv.tracker.foreground.regions import RegionLimits, regions_of
from zv.tracker.foreground.steadying import SteadyLimits
from zv.tracker.tracking.region import Region


def backdrop() -> np.ndarray:
    """Return (120, 160, 3) with texture, between 60 and 150."""
    coarse = np.random.default_rng(2).uniform(60, 150, (15, 20, 3)).astype(np.float32)
    return cv2.resize(coarse, (160, 120)).astype(np.uint8)


def learned(**changes: object) -> ForegroundDetector:
    """Return a detector that has seen 6 s of the empty scene."""
    found = ForegroundDetector(ForegroundParameters(**changes))  # type: ignore[arg-type]
    for k in range(60):
        found.update(backdrop(), k / 10, [])
    return found


@pytest.mark.parametrize("size", [(1, 8192), (8192, 1), (2, 30000)])
def test_a_line_camera_s_pictures_have_a_foreground(size: tuple[int, int]):
    detector = ForegroundDetector(ForegroundParameters())
    picture = np.full((*size, 3), 90, np.uint8)
    for k in range(20):
        assert not detector.update(picture, k / 10, [])[0].any()


def with_object(x: int = 60) -> np.ndarray:
    picture = backdrop()
    picture[40:80, x : x + 20] = (30, 30, 220)
    return picture


def expected(x: int = 60) -> np.ndarray:
    mask = np.zeros((120, 160), np.uint8)
    mask[40:80, x : x + 20] = 255
    return mask


def test_exactly_the_object_is_foreground():
    mask, strong, shown = learned().update(with_object(), 6.0, [])
    assert np.count_nonzero(mask != expected()) <= 8  # the corners, by the median
    assert np.count_nonzero(strong) > 400  # half of the object
    assert shown == "scene"


def test_a_pixel_of_shake_makes_nothing_foreground_in_a_grating():
    grating = np.full((60, 80, 3), 100, np.uint8)
    grating[:, ::2] = 190
    background = Background(grating, BackgroundLimits(), LightLimits())
    shaken = np.roll(grating, 1, axis=1)
    assert not background.foreground(shaken, shadows=False)[0].any()
    shaken[20:40, 30:50] = 20
    mask, _ = background.foreground(shaken, shadows=False)
    assert np.count_nonzero(mask) == np.count_nonzero(mask[20:40, 30:50]) > 390  # but corners


def test_nothing_is_foreground_in_the_first_half_second():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(5):
        mask, _, _ = found.update(with_object(10 + 10 * k), k / 10, [])
        assert not mask.any()


def test_a_person_who_walks_away_in_the_first_seconds_leaves_no_ghost():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(45):
        mask, _, _ = found.update(with_object(min(135, 5 + 6 * k)), k / 10, [])
    assert not mask[:, :100].any()


def test_a_standing_object_stays_foreground_if_known_and_becomes_background_if_not():
    known, unknown = learned(), learned()
    box = [Region(60, 40, 80, 80, 800)]
    for k in range(60, 660):
        still, _, _ = known.update(with_object(), k / 10, box)
        gone, _, _ = unknown.update(with_object(), k / 10, [])
    assert np.count_nonzero(still[40:80, 60:80]) > 780
    assert not gone.any()


def test_nothing_is_learned_while_frozen():
    found = learned()
    found.parameters = ForegroundParameters(frozen=True)
    for k in range(60, 660):
        mask, _, _ = found.update(with_object(), k / 10, [])
    assert np.count_nonzero(mask[40:80, 60:80]) > 780


@pytest.mark.parametrize(
    "light",
    [
        pytest.param(lambda values: 1.4 * values, id="gain"),
        pytest.param(lambda values: 0.6 * values, id="less gain"),
        pytest.param(lambda values: values + 30, id="offset"),
        pytest.param(lambda values: 255 * (values / 255) ** 0.7, id="gamma"),
        pytest.param(lambda values: values * np.array([1.15, 1.0, 0.85]), id="white balance"),
    ],
)
def test_an_object_is_all_that_is_foreground_when_the_light_of_the_scene_has_changed(light):
    found = learned()
    picture = np.clip(light(with_object().astype(np.float32)), 0, 255).astype(np.uint8)
    mask, _, shown = found.update(picture, 6.0, [])
    assert np.count_nonzero(mask != expected()) <= 30
    assert shown == "scene"


def test_a_lamp_over_two_fifths_of_the_picture_is_learned_and_spoils_nothing_beside_it():
    """What lies between light for the whole picture and an object is learned as a change is."""
    found, lit = learned(), 64  # the columns in the light of the lamp
    for k in range(60, 460):
        picture = with_object(120)
        picture[:, :lit] += 50
        mask, _, shown = found.update(picture, k / 10, [Region(120, 40, 140, 80, 800)])
        beside = mask[:, lit + 4 :] != expected(120)[:, lit + 4 :]
        assert (shown, np.count_nonzero(beside) <= 8) == ("scene", True)
    assert not mask[:, :lit].any()


def test_where_traffic_hides_most_of_the_scene_its_colours_are_not_taken_for_light():
    found = learned()
    rng = np.random.default_rng(3)
    for k in range(60, 120):
        picture = backdrop()
        picture[:, :100] = rng.integers(0, 60, 3)  # five eighths of the picture, flat
        found.update(picture, k / 10, [Region(0, 0, 100, 120, 12000)])
    mask, _, _ = found.update(with_object(120), 12.0, [])
    assert np.count_nonzero(mask[:, 104:] != expected(120)[:, 104:]) <= 8


def test_objects_are_detected_inside_regions_and_not_inside_ignored_ones():
    left = ((0.0, 0.0), (70.0, 0.0), (70.0, 120.0), (0.0, 120.0))
    inside = learned(regions=(left,)).update(with_object(), 6.0, [])[0]
    outside = learned(ignored=(left,)).update(with_object(), 6.0, [])[0]
    assert inside[60, 65] == 255
    assert inside[60, 75] == 0
    assert outside[60, 65] == 0
    assert outside[60, 75] == 255


def test_a_shadow_is_left_out():
    picture = backdrop().astype(np.float32)
    picture[40:80, 60:80] *= 0.75
    shadow = picture.astype(np.uint8)
    assert not learned().update(shadow, 6.0, [])[0].any()
    assert learned(detect_shadows=False).update(shadow, 6.0, [])[0].any()


def test_a_dark_object_in_haze_is_no_shadow_but_a_shadow_is():
    """Haze that halves the contrast makes 0.4 of the brightness 0.64 to 0.78 of it."""

    def shown(part: float) -> np.ndarray:
        scene = backdrop().astype(np.float32)
        scene[:10], scene[10:20] = 0, 255
        scene[40:80, 60:80] *= part
        return (50 + 0.5 * scene).astype(np.uint8)

    background = Background(shown(1.0), BackgroundLimits(), LightLimits())
    mask, _ = background.foreground(shown(0.4), shadows=True)
    assert np.count_nonzero(mask != expected()) <= 8  # the corners, by the median
    assert not background.foreground(shown(0.8), shadows=True)[0].any()


def test_another_threshold_applies_at_once():
    picture = backdrop()
    picture[40:80, 60:80] += 40
    found = learned()
    assert found.update(picture, 6.0, [])[0][60, 70] == 255
    found.parameters = ForegroundParameters(var_threshold=900.0)
    assert not found.update(picture, 6.1, [])[0].any()


def test_the_limit_of_a_pixel_follows_its_noise():
    rng = np.random.default_rng(1)
    found = ForegroundDetector(ForegroundParameters())
    for k in range(100):
        picture = backdrop().astype(np.int16)
        picture[:, :80] += rng.integers(-25, 26, (120, 80, 1))
        mask, _, _ = found.update(np.clip(picture, 0, 255).astype(np.uint8), k / 10, [])
    assert np.count_nonzero(mask) < 0.01 * mask.size
    slightly = backdrop()
    slightly[40:80, 100:120] += 30
    assert found.update(slightly, 10.0, [])[0][60, 110] == 255


def regions(mask: np.ndarray, least: float = 20, **changes: float) -> list[Region]:
    return regions_of(mask, mask, least, np.inf, replace(RegionLimits(), **changes))


def test_a_region_counts_its_own_pixels_and_not_those_of_another_in_its_box():
    mask = np.zeros((100, 100), np.uint8)
    mask[10:80, 10:20] = mask[70:80, 10:90] = 255  # an L
    mask[20:60, 40:70] = 255  # an object in its angle
    found = {each.area: each for each in regions(mask)}
    assert set(found) == {70 * 10 + 80 * 10 - 100, 40 * 30}
    assert found[1200].pixels_at == pytest.approx((55, 40))


def test_a_region_in_the_hole_of_another_is_found():
    mask = np.zeros((100, 100), np.uint8)
    mask[10:90, 10:90] = 255
    mask[20:80, 20:80] = 0
    mask[40:60, 40:60] = 255
    assert [each.area for each in regions(mask)] == [6400 - 3600, 400]


def test_regions_outside_the_limits_of_the_area_are_left_out():
    mask = np.zeros((100, 100), np.uint8)
    mask[10:14, 10:14] = mask[60:80, 10:40] = 255
    assert [each.area for each in regions(mask)] == [600]
    assert regions_of(mask, mask, 20, 500, RegionLimits()) == []


def test_a_tape_that_touches_an_object_is_not_part_of_it():
    mask = np.zeros((100, 100), np.uint8)
    mask[30:80, 40:60] = mask[50:52, 0:100] = 255
    (found,) = regions(mask)
    assert found[:4] == (40, 30, 60, 80)


def test_a_region_without_strong_pixels_is_noise():
    mask = np.zeros((100, 100), np.uint8)
    mask[30:80, 40:60] = 255
    assert regions_of(mask, np.zeros_like(mask), 20, np.inf, RegionLimits()) == []


@pytest.mark.parametrize(
    "limits", [BackgroundLimits, LightLimits, SceneLimits, RegionLimits, SteadyLimits]
)
def test_the_constants_say_what_they_are(limits: type):
    lines = [line.strip() for line in inspect.getsource(limits).splitlines()]
    for name in limits.__slots__:  # type: ignore[attr-defined]
        (at,) = (number for number, line in enumerate(lines) if line.startswith(f"{name}: "))
        assert "  # " in lines[at] or lines[at - 1].startswith("# ")
