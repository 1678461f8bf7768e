"""Finding an object in the region of others by its colours."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.searching import found_in
from zv.tracker.tracking.target import Target, new_target

RED, GREEN, BLUE = (20, 20, 200), (40, 180, 40), (200, 60, 20)
Box = tuple[int, int, int, int]  # left, top, right, bottom
WALL, LAST, REACH = (20, 20, 180, 100), (100.0, 60.0), 30.0


def painted(*objects: tuple[Box, tuple[int, int, int]]) -> Scene:
    """Return a scene of rectangles, the last one in front."""
    picture, mask = np.full((120, 200, 3), 120, np.uint8), np.zeros((120, 200), np.uint8)
    for (left, top, right, bottom), color in objects:
        picture[top:bottom, left:right], mask[top:bottom, left:right] = color, 255
    return Scene(picture, mask)


def fragment(box: Box) -> Fragment:
    left, top, right, bottom = box
    return Fragment(left, top, right, bottom, (right - left) * (bottom - top))


def known(box: Box, *objects: tuple[Box, tuple[int, int, int]]) -> Target:
    """Return an object that was seen in a box of a scene."""
    target = new_target(1, fragment(box), 0)
    target.appearance.learn(painted(*objects), fragment(box), 1.0)
    return target


RED_BOX, WALL_ALONE = (90, 50, 110, 70), known(WALL, (WALL, GREEN))


@pytest.mark.parametrize(
    ("box", "share"),
    [
        pytest.param((110, 50, 130, 70), 1.0, id="20 pixels aside"),
        pytest.param((110, 50, 130, 55), 0.25, id="a quarter of it"),
        pytest.param((115, 75, 135, 95), 0.0, id="35 pixels away diagonally"),
    ],
)
def test_an_object_is_found_where_its_colours_are_if_it_may_have_come_there(
    box: Box, share: float
) -> None:
    scene = painted((WALL, GREEN), (box, RED))
    target = known(RED_BOX, (RED_BOX, RED))
    found, _ = found_in(fragment(WALL), target, [WALL_ALONE], LAST, REACH, scene)
    assert found == pytest.approx(share, abs=0.01)


def test_an_object_is_not_found_by_a_colour_that_it_hardly_ever_showed() -> None:
    speck = (100, 60, 101, 62)  # 2 of its 400 pixels
    target = known(RED_BOX, (RED_BOX, RED), (speck, BLUE))
    scene = painted((WALL, GREEN), (RED_BOX, BLUE))
    share, _ = found_in(fragment(WALL), target, [WALL_ALONE], LAST, REACH, scene)
    assert share == 0
