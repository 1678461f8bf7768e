"""What an object leaves in the background, on painted scenes."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.foreground.ghosts import evidence

RNG = np.random.default_rng(5)
ROAD = np.repeat(RNG.integers(120, 132, (80, 120, 1)), 3, 2).astype(np.uint8)
CAR = (40, 30, 90)


def parked(*columns: tuple[int, int]) -> np.ndarray:
    """Return the road with cars in rows 30 to 50."""
    picture = ROAD.copy()
    for first, end in columns:
        picture[30:50, first:end] = CAR
    return picture


def mask(*columns: tuple[int, int]) -> np.ndarray:
    found = np.zeros((80, 120), np.uint8)
    for first, end in columns:
        found[30:50, first:end] = 255
    return found


def test_an_object_has_more_evidence_than_its_ghost():
    where = mask((30, 60))
    assert evidence(parked((30, 60)), ROAD, where, where) > 5
    assert evidence(ROAD, parked((30, 60)), where, where) < 0.2


@pytest.mark.parametrize("texture", [0, 40])
def test_a_plain_object_before_a_textured_background_is_an_object(texture: int):
    rough = np.clip(ROAD.astype(int) + RNG.integers(-texture, texture + 1, ROAD.shape), 0, 255)
    picture = rough.astype(np.uint8)
    picture[30:50, 30:60] = 127 if texture else 160
    where = mask((30, 60))
    assert evidence(picture, rough.astype(np.uint8), where, where) > 1
