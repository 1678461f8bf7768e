"""Dividing a foreground region that several objects share: each gets its own pixels."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.tracking.appearance import Scene, learned
from zv.tracker.tracking.groups import divide
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import TrackState

SIZE = (100, 200)  # rows, columns
RED, BLUE = (20, 20, 200), (200, 60, 20)
Box = tuple[int, int, int, int]  # left, top, right, bottom


def painted(*objects: tuple[Box, tuple[int, int, int]]) -> Scene:
    """Return a scene of rectangles, the last one in front."""
    picture = np.full((*SIZE, 3), 120, np.uint8)
    mask = np.zeros(SIZE, np.uint8)
    for (left, top, right, bottom), color in objects:
        picture[top:bottom, left:right] = color
        mask[top:bottom, left:right] = 255
    return Scene(picture, mask)


def known(number: int, seen: Box, color: tuple[int, int, int], at: Box) -> TrackState:
    """Return an object that was seen alone in one box and is expected in another one."""
    target = TrackState.new(number, region(at), 0.0)
    target.colors = learned(None, painted((seen, color)), region(seen), 1.0)
    return target


def region(box: Box) -> Region:
    left, top, right, bottom = box
    return Region(left, top, right, bottom, (right - left) * (bottom - top))


def edges(box: Region | None) -> tuple[float, float, float, float]:
    assert box is not None
    return box.left, box.top, box.right, box.bottom


def test_colours_divide_a_region_where_the_prediction_is_some_pixels_off():
    front, behind = (60, 20, 80, 90), (70, 40, 110, 60)
    scene = painted((behind, BLUE), (front, RED))
    one = known(1, (20, 20, 40, 90), RED, (57, 22, 77, 92))
    two = known(2, (120, 40, 160, 60), BLUE, (74, 40, 114, 60))
    of_one, of_two = divide([one, two], [region((60, 20, 110, 90))], scene)
    assert edges(of_one) == pytest.approx(front, abs=1)
    assert edges(of_two) == pytest.approx((80, 40, 110, 60), abs=1)
    areas = [each and each.area for each in (of_one, of_two)]
    assert areas == pytest.approx([20 * 70, 30 * 20], rel=0.05)


def test_objects_of_the_same_colour_are_divided_by_their_positions():
    left, right = (40, 20, 60, 80), (55, 24, 75, 84)
    scene = painted((left, RED), (right, RED))
    seen = (120, 20, 140, 80)
    of_left, of_right = divide(
        [known(1, seen, RED, left), known(2, seen, RED, right)], [region((40, 20, 75, 84))], scene
    )
    assert edges(of_left)[0] == 40
    assert edges(of_right)[2] == 75


def test_an_object_behind_another_one_has_no_pixels():
    front = (60, 10, 100, 90)
    scene = painted((front, RED))
    hidden = known(2, (120, 40, 140, 60), BLUE, (70, 40, 90, 60))
    of_front, of_hidden = divide(
        [known(1, (10, 10, 50, 90), RED, front), hidden], [region(front)], scene
    )
    assert of_hidden is None
    assert edges(of_front) == front


def test_only_one_of_two_tracks_of_an_object_has_pixels():
    at, seen = (60, 20, 80, 80), (120, 20, 140, 80)
    one, other = divide(
        [known(1, seen, RED, at), known(2, seen, RED, at)], [region(at)], painted((at, RED))
    )
    assert edges(one) == at
    assert other is None


def test_foreground_outside_of_a_shared_region_is_not_divided():
    one, two, elsewhere = (40, 20, 60, 80), (60, 50, 80, 80), (62, 24, 80, 46)
    scene = painted((one, RED), (two, BLUE), (elsewhere, BLUE))
    _, of_two = divide(
        [known(1, one, RED, one), known(2, two, BLUE, (60, 46, 80, 76))],
        [region(one), region(two)],
        scene,
    )
    assert edges(of_two) == two
