"""The appearance of an object: how its colours are compared."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.tracking.appearance import Appearance, Scene
from zv.tracker.tracking.region import Region

BOX = Region(0, 0, 40, 40, 1600)


def scene(rows: int, color: tuple[int, int, int]) -> Scene:
    """Return a scene in which an object of so many rows has one colour."""
    picture, mask = np.full((40, 40, 3), 120, np.uint8), np.zeros((40, 40), np.uint8)
    picture[:rows, :40], mask[:rows, :40] = color, 255
    return Scene(picture, mask)


@pytest.mark.parametrize("rows", [2, 3, 4, 6, 40])
def test_an_object_of_few_rows_looks_like_itself_and_not_like_one_of_other_colours(rows: int):
    """It has fewer rows than there are bands, so that some bands are empty."""
    box = Region(0, 0, 40, rows, 40 * rows)
    red, blue = scene(rows, (20, 20, 200)), scene(rows, (200, 60, 20))
    looks = Appearance()
    looks.learn(red, box, 1.0)
    assert looks.distance(red, box) == pytest.approx(0.0, abs=1e-3)
    assert looks.distance(blue, box) == pytest.approx(1.0, abs=1e-3)


def test_what_was_never_learned_is_neither_alike_nor_unlike():
    assert Appearance().distance(scene(40, (20, 20, 200)), BOX) == 0.5
