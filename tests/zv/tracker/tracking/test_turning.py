"""Objects that turn between two frames."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.fragments import fragments_of
from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

WIDTH, HEIGHT, SIDE = 320, 240, 28
RED, GREEN = (40, 40, 200), (40, 180, 40)


def seen(
    tracker: Tracker,
    time_s: float,
    centre: tuple[float, float],
    bgr: tuple[int, int, int] = RED,
    boxes: Sequence[tuple[int, int, int, int]] = (),
) -> set[int]:
    """Show the tracker a disc, and a standing box if wanted; return the confirmed tracks' ids."""
    picture = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    for left, top, right, bottom in boxes:
        picture[top:bottom, left:right], mask[top:bottom, left:right] = GREEN, 255
    place = round(centre[0]), round(centre[1])
    cv2.circle(picture, place, SIDE // 2, bgr, -1)
    cv2.circle(mask, place, SIDE // 2, 255, -1)
    tracks = tracker.update(
        fragments_of(mask, 10.0, math.inf), round(time_s * 1e9), Scene(picture, mask)
    )
    return {track.id for track in tracks if track.state == "confirmed"}


@pytest.mark.parametrize(("rate_hz", "speed"), [(30, 200), (10, 200), (5, 120)])
def test_an_object_that_turns_back_keeps_its_id_at_any_rate(rate_hz: int, speed: float) -> None:
    tracker, ids = Tracker(TrackingParameters(), (WIDTH, HEIGHT)), set()
    for index in range(5 * rate_hz):
        way = speed * index / rate_hz % 440
        ids |= seen(tracker, index / rate_hz, (50 + min(way, 440 - way), 120.0))
    assert len(ids) == 1


def test_an_object_of_other_colours_beside_the_last_place_is_another_one() -> None:
    tracker = Tracker(TrackingParameters(), (WIDTH, HEIGHT))
    for index in range(6):
        before = seen(tracker, index / 5, (40 + 24 * index, 60.0))
    for index in range(6, 12):
        after = seen(tracker, index / 5, (120 - 12 * (index - 6), 88.0), GREEN)
    assert before == {1}
    assert after
    assert not after & before


@pytest.mark.parametrize(("rate_hz", "speed"), [(10, 200), (5, 120), (10, 400), (5, 250)])
def test_an_object_that_turns_before_it_reaches_another_one_keeps_its_id(
    rate_hz: int, speed: float
) -> None:
    tracker, ids = Tracker(TrackingParameters(), (WIDTH, HEIGHT)), set()
    for index in range(4 * rate_hz):  # it turns 4 pixels before the box, where its motion leads
        x = 60 + abs((speed * index / rate_hz + 150) % 300 - 150)
        ids |= seen(tracker, index / rate_hz, (x, 120.0), boxes=[(228, 80, 310, 160)])
    assert len(ids) == 1


@pytest.mark.parametrize(("sides", "is_same"), [(2.1, True), (2.5, False)])
def test_a_slow_object_is_found_as_far_away_as_eight_sides_per_second_allow(
    sides: float, is_same: bool
) -> None:
    tracker = Tracker(TrackingParameters(), (WIDTH, HEIGHT))
    for index in range(8):
        before = seen(tracker, index / 5, (60 + 4 * index, 40.0))
    # In 0.2 s, 8 * 0.2 sides and the 0.7 of any search around an expected place: 2.3 sides.
    for index in range(8, 14):
        after = seen(tracker, index / 5, (88 + 4 * (index - 8), 40.0 + sides * SIDE))
    assert before == {1}
    assert (after == before) is is_same


def up_and_down(time_s: float) -> tuple[float, float]:
    """Return the place of a disc that keeps turning, from 1.4 s on half before ``WALL``."""
    return min(60 + 100 * time_s, 198), 70 + abs((200 * time_s + 100) % 200 - 100)


WALL = (200, 50, 280, 190)


@pytest.mark.parametrize("rate_hz", [10, 5])
def test_an_object_that_keeps_turning_in_the_region_of_another_one_stays_confirmed(
    rate_hz: int,
) -> None:
    tracker, ids = Tracker(TrackingParameters(), (WIDTH, HEIGHT)), []
    for index in range(4 * rate_hz):
        time_s = index / rate_hz
        ids.append(seen(tracker, time_s, up_and_down(time_s), boxes=[WALL]))
    assert ids[rate_hz:] == [{2}] * (3 * rate_hz)


def test_an_object_found_where_it_has_turned_is_seen_once_in_that_frame() -> None:
    tracker, hits = Tracker(TrackingParameters(), (WIDTH, HEIGHT)), []
    for index in range(14):  # at 8 Hz; it turns at 1.5 s, before the last frame
        seen(tracker, index / 8, up_and_down(index / 8), boxes=[WALL])
        hits.append(tracker.targets[-1].hits)
    assert hits == list(range(1, 15))
    assert tracker.targets[-1].box.center == pytest.approx(up_and_down(13 / 8), abs=3)
