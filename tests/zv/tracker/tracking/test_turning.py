"""Objects that turn between two frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.fragments import fragments_of
from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

WIDTH, HEIGHT, SIDE = 320, 240, 28
RED, GREEN, BLUE = (40, 40, 200), (40, 180, 40), (200, 60, 20)
Box = tuple[int, int, int, int]  # left, top, right, bottom


def seen(
    tracker: Tracker,
    time_s: float,
    centre: tuple[float, float] | None,
    bgr: tuple[int, int, int] = RED,
    boxes: Sequence[Box] = (),
    poster: Box = (0, 0, 0, 0),
) -> set[int]:
    """Show the tracker a disc, and a standing box if wanted; return the confirmed tracks' ids.

    A poster is red, and not foreground by itself.
    """
    picture = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    for left, top, right, bottom in boxes:
        picture[top:bottom, left:right], mask[top:bottom, left:right] = GREEN, 255
    if centre is not None:
        place = round(centre[0]), round(centre[1])
        cv2.circle(picture, place, SIDE // 2, bgr, -1)
        cv2.circle(mask, place, SIDE // 2, 255, -1)
    left, top, right, bottom = poster
    picture[top:bottom, left:right] = RED
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


def missing(
    disc_since: int = 0,
    wall_since: int = 0,
    hidden_at: Sequence[int] = (),
    last: tuple[int, int, int] = RED,
    poster: Box = (0, 0, 0, 0),
) -> list[float]:
    """Return for how many frames a disc is missing that has turned, and is half before a wall.

    It was alone before the last of 14 frames at 8 Hz.

    Args:
        disc_since: Number of the first frame with the disc.
        wall_since: Number of the first frame with the wall.
        hidden_at: Numbers of frames without the disc.
        last: Colour of the disc in the last frame.
        poster: A poster in the last frame.
    """
    tracker = Tracker(TrackingParameters(), (WIDTH, HEIGHT))
    for index in range(14):
        centre = up_and_down(index / 8) if index < 13 else (213, 145)
        is_shown = index >= disc_since and index not in hidden_at
        boxes = [(215, 50, 295, 190)] if index >= wall_since else []
        colour, on_wall = (last, poster) if index == 13 else (RED, (0, 0, 0, 0))
        seen(tracker, index / 8, centre if is_shown else None, colour, boxes, on_wall)
    return [8 * track.missing_s for track in tracker.tracks() if track.area < 1000]


@pytest.mark.parametrize(
    ("changes", "frames"),
    [
        pytest.param({}, 0, id="found"),
        pytest.param({"last": BLUE, "poster": (209, 141, 217, 149)}, 1, id="only a tenth is red"),
        pytest.param({"hidden_at": [13], "poster": (216, 135, 242, 161)}, 1, id="a red poster"),
        pytest.param({"wall_since": 10}, 1, id="the wall is hardly known"),
        pytest.param({"disc_since": 10}, 1, id="the disc is hardly known"),
        pytest.param({"hidden_at": [12]}, 2, id="not seen in the last frame"),
    ],
)
def test_an_object_is_found_in_the_region_of_another_one_only_if_its_colours_prove_it(
    changes: dict[str, Any], frames: float
) -> None:
    assert missing(**changes) == [frames]


def test_turning_before_another_object_changes_the_velocity_as_turning_alone_does() -> None:
    velocities = []
    for boxes in ([], [(228, 80, 310, 160)]):
        tracker = Tracker(TrackingParameters(), (WIDTH, HEIGHT))
        for index in range(7):  # at 10 Hz; it turns at 0.5 s, where its motion leads into the box
            x = 60 + abs((30 * index + 150) % 300 - 150)
            seen(tracker, index / 10, (x, 120.0), boxes=boxes)
        velocities.append([each.vx for each in tracker.tracks() if each.area < 1000])
    assert velocities[0] == pytest.approx(velocities[1])
