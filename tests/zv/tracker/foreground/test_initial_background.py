"""The background of the first seconds, behind objects that move in them."""

from __future__ import annotations

import numpy as np
import pytest

from zv.tracker.foreground.foreground import ForegroundDetector, ForegroundParameters
from zv.tracker.foreground.initial_background import usual_colours
from zv.tracker.tracking.fragment import Fragment

TENTH = 100_000_000
GREY = (110, 120, 130)


def empty() -> np.ndarray:
    """Return (60, 120, 3), a plain background."""
    return np.full((60, 120, 3), GREY, np.uint8)


def shown(colours: list[tuple[int, int, int]]) -> list[np.ndarray]:
    """Return pictures of one pixel that has these colours one after the other."""
    return [np.full((1, 1, 3), colour, np.uint8) for colour in colours]


def everywhere(pictures: list[np.ndarray]) -> list[np.ndarray]:
    return [np.ones(picture.shape[:2], np.uint8) for picture in pictures]


def test_the_background_is_the_recurring_colour_even_if_it_is_mostly_hidden():
    passing = [(k, 40, 200 - k) for k in (0, 30, 60, 90, 120, 150)]
    pictures = shown([*passing[:4], GREY, (112, 122, 132), *passing[4:], (111, 121, 131)])
    found = usual_colours(pictures, everywhere(pictures))
    assert found.tolist() == [[[111, 121, 131]]]  # the mean of the three


def test_known_objects_are_ignored_in_the_pictures():
    red = [(20, 20, 200)] * 5
    pictures = shown([GREY, GREY, GREY, *red])
    free = everywhere(pictures)
    assert usual_colours(pictures, free).tolist() == [[[20, 20, 200]]]
    for each in free[3:]:
        each[:] = 0
    assert usual_colours(pictures, free).tolist() == [[list(GREY)]]


def test_the_background_is_the_median_without_three_pictures_of_one_colour():
    pictures = shown([(0, 0, 0), (50, 50, 50), (90, 90, 90)])
    assert usual_colours(pictures, everywhere(pictures)).tolist() == [[[50, 50, 50]]]


def usual_colour(colours: np.ndarray, free: np.ndarray) -> list[int]:
    """Return the usual colour of one pixel by its definition: (n, 3) colours, (n,) 0 or 1."""
    nine = [round(at) for at in np.linspace(0, len(colours) - 1, 9)]
    thirds = [np.median(colours[nine[k::3]], axis=0) for k in range(3)]
    places = sorted(set(nine))  # nine pictures at most are compared
    colours, free = colours[places], free[places]
    same = (np.abs(colours[:, None] - colours) <= 20).all(axis=2) & (free[:, None] & free > 0)
    found = (np.abs(colours - colours[same.sum(axis=0).argmax()]) <= 20).all(axis=1) & (free > 0)
    if found.sum() < 3:
        return np.median(thirds, axis=0).astype(int).tolist()
    return np.rint(colours[found].sum(axis=0) / np.float32(found.sum())).astype(int).tolist()


@pytest.mark.parametrize("number", [3, 5, 9, 14])
def test_each_pixel_of_random_pictures_gets_the_colour_that_the_definition_gives(number):
    random = np.random.default_rng(7)
    pictures = random.choice([40, 55, 75, 96, 130], (number, 11, 13, 3)).astype(np.uint8)
    free = (random.random((number, 11, 13)) < 0.8).astype(np.uint8)
    before = pictures.copy(), free.copy()
    found = usual_colours(list(pictures), list(free))
    expected = [
        [usual_colour(pictures[:, y, x].astype(int), free[:, y, x]) for x in range(13)]
        for y in range(11)
    ]
    assert found.tolist() == expected
    assert np.array_equal(pictures, before[0])
    assert np.array_equal(free, before[1])


def test_a_tracked_person_who_stands_in_the_first_seconds_is_not_learned():
    found = ForegroundDetector(ForegroundParameters())
    for k in range(60):
        picture, left = empty(), min(60, 4 * k)
        picture[10:50, left : left + 20] = (20, 20, 200)
        known = [Fragment(left, 10, left + 20, 50, 800)] if k >= 12 else []
        mask, _ = found.update(picture, k * TENTH, known)
    assert np.count_nonzero(mask[10:50, 60:80]) > 700
