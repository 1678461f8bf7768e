"""Each crossing of a line is reported exactly once, with its direction, time and place."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.track_walks import STEP_NS, crossings, rules, track, walk
from zv.tracker.events.track_events import TrackEvents

# From (100, 0) down to (100, 200): seen from its first point, its right side is where x < 100.
GATE = "gate 100,0 100,200"


def gate(**changes) -> TrackEvents:
    return TrackEvents(rules(lines_=GATE, **changes))


def test_a_jump_over_the_line_is_one_crossing_interpolated_between_the_frames():
    found = walk(gate(), [(40, 50), (60, 60), (140, 100)])
    (crossing,) = [event for event in found if event.kind == "line_crossed"]
    # From x = 60 at 100 ms to x = 140 at 200 ms: half way at 150 ms, where y = 80.
    assert (crossing.shape, crossing.direction, crossing.count) == ("gate", "left", 1)
    assert crossing.at.stamp_ns == 150_000_000
    assert crossing.at.pixel == (100, 80)


def test_crossing_back_has_the_other_direction_and_a_separate_count():
    events = gate()
    found = walk(events, [(60, 50), (140, 50), (60, 50), (140, 50)])
    assert crossings(found) == ["left", "right", "left"]
    assert [event.count for event in found if event.shape] == [1, 1, 2]
    count = events.counts.lines["gate"]
    assert (count.left, count.right) == (2, 1)


@pytest.mark.parametrize(
    "line", ["gate 0,100 200,100", "gate 200,100 0,100", "gate 0,0 200,200", "gate 9,200 200,9"]
)
def test_right_is_the_right_hand_side_when_walking_from_the_first_point(line: str):
    first, second = (tuple(map(float, point.split(","))) for point in line.split()[1:])
    # Right of the way (dx, dy) is (-dy, dx), since y points down.
    dx, dy = second[0] - first[0], second[1] - first[1]
    middle = (first[0] + second[0]) / 2, (first[1] + second[1]) / 2
    to_right = middle[0] - dy / 4, middle[1] + dx / 4
    to_left = middle[0] + dy / 4, middle[1] - dx / 4
    found = walk(TrackEvents(rules(lines_=line)), [to_left, to_right, to_left])
    assert crossings(found) == ["right", "left"]


def test_an_object_that_stands_on_the_line_and_goes_back_does_not_cross_it():
    way = [(60, 50), *[(100, 50)] * 9, (100.5, 50), (99.5, 50), (100, 50), (60, 50)]
    assert crossings(walk(gate(), way, end=True)) == []


def test_an_object_that_stands_on_the_line_and_goes_on_crosses_it_once_at_that_time():
    way = [(60, 50), *[(100, 50)] * 9, (140, 50)]
    found = walk(gate(), way, end=True)
    (crossing,) = [event for event in found if event.kind == "line_crossed"]
    # On the line at 100 ms to 900 ms, beyond it at 1 s: the passage begins at 900 ms.
    assert crossing.at.stamp_ns == 900_000_000


def test_a_track_that_ends_just_beyond_the_line_has_crossed_it():
    found = walk(gate(), [(60, 50), (99, 50), (101, 50)], end=True)
    assert [event.kind for event in found][-2:] == ["line_crossed", "ended"]
    assert [event.at.stamp_ns for event in found][-2:] == [150_000_000, 200_000_000]


def test_predicted_positions_do_not_cross():
    events = gate()
    found = walk(events, [(60, 50), (90, 50)])
    for number, x in enumerate((100, 110, 120), 2):
        found += events.update([track(x, 50, state="lost", missing_s=0.1)], number * STEP_NS)
        found += events.update([track(x, 50, missing_s=0.1)], number * STEP_NS)
    assert crossings(found) == []
    # Seen again on the same side: the prediction was wrong.
    assert crossings(walk(events, [(85, 50)], start=5)) == []


def test_a_hidden_crossing_is_reported_once_interpolated_between_the_sightings():
    events = gate()
    walk(events, [(60, 50), (80, 50)])
    events.update([track(95, 50, state="lost", missing_s=0.1)], 2 * STEP_NS)
    found = walk(events, [(120, 50)], start=3)
    # From x = 80 at 100 ms to x = 120 at 300 ms.
    assert [event.at.stamp_ns for event in found if event.shape] == [200_000_000]


def test_a_crossing_before_the_track_is_confirmed_is_reported_when_it_is():
    events = gate()
    found = []
    for number, x in enumerate((60, 140, 150)):
        found += events.update([track(x, 50, state="tentative")], number * STEP_NS)
    assert found == []
    found = walk(events, [(160, 50)], start=3)
    assert [event.kind for event in found] == ["started", "line_crossed", "confirmed"]
    assert [event.at.stamp_ns for event in found] == [0, 50_000_000, 300_000_000]


def test_each_crossing_before_the_track_is_confirmed_is_reported_when_it_is():
    events = gate()
    for number, x in enumerate((60, 140, 60, 140)):
        events.update([track(x, 50, state="tentative")], number * STEP_NS)
    found = walk(events, [(60, 50), (50, 50)], start=4, end=True)
    assert crossings(found) == ["left", "right", "left", "right"]
    passed = [event.at.stamp_ns // 1_000_000 for event in found if event.shape]
    assert passed == [50, 150, 250, 350]


def test_repeated_or_earlier_stamps_give_one_crossing_at_no_earlier_time():
    events = gate()
    found = []
    for x, stamp_ns in ((60, 5 * STEP_NS), (90, 5 * STEP_NS), (130, 3 * STEP_NS), (140, 0)):
        found += events.update([track(x, 50)], stamp_ns)
    assert crossings(found) == ["left"]
    assert {event.at.stamp_ns for event in found} == {5 * STEP_NS}


def test_the_foot_crosses_where_the_centre_does_not():
    way = [(100, 80), (100, 95)]  # the box reaches 10 pixels farther down
    line = "floor 0,100 200,100"
    assert crossings(walk(TrackEvents(rules(lines_=line, anchor="foot")), way)) == ["right"]
    assert crossings(walk(TrackEvents(rules(lines_=line, anchor="centre")), way)) == []


def test_a_change_of_the_anchor_is_not_a_crossing():
    events = TrackEvents(rules(lines_="floor 0,100 200,100"))
    walk(events, [(100, 95)] * 3)
    events.adjust(rules(lines_="floor 0,100 200,100", anchor="foot"))
    assert crossings(walk(events, [(100, 95)] * 3, start=3, end=True)) == []


def test_an_unchanged_line_keeps_paths_and_counts_while_others_change():
    events = gate()
    walk(events, [(60, 50), (140, 50), (140, 90)])
    events.adjust(rules(lines_=f"{GATE}; other 0,0 9,9"))
    found = walk(events, [(60, 90)], start=3)
    assert [(event.direction, event.count) for event in found] == [("right", 1)]
    assert events.counts.lines["gate"].left == 1


def test_a_moved_line_counts_from_0_and_from_the_current_positions():
    events = gate()
    walk(events, [(60, 50), (140, 50)])
    events.adjust(rules(lines_="gate 150,0 150,200"))
    assert events.counts.lines["gate"].left == 0
    assert crossings(walk(events, [(140, 50), (160, 50)], start=2)) == ["left"]


# A walk on the points of a grid never touches lines at half coordinates. Steps and margin are
# chosen so that each position is beyond the margin: then every passage is reported at once.
@settings(deadline=None)
@given(st.lists(st.sampled_from([(9, 0), (-9, 0), (0, 9), (0, -9), (9, 9)]), max_size=60))
def test_the_crossings_of_a_walk_on_a_grid_are_those_of_its_steps(steps):
    """The oracle compares whole numbers: a step passes x = 4.5 if it begins left and ends right of
    it; the line is from y = -12 to 12, and y is a multiple of 4.5 where a step passes x = 4.5.
    """
    x = y = 0
    way = [(x, y)]
    expected = []
    for dx, dy in steps:
        middle = y + dy / 2
        if dx and min(x, x + dx) == 0 and -12 < middle < 12:
            expected.append("left" if dx > 0 else "right")
        x, y = x + dx, y + dy
        way.append((x, y))
    events = TrackEvents(rules(lines_="gate 4.5,-12 4.5,12"))
    assert crossings(walk(events, way, end=True)) == expected


@settings(deadline=None)
@given(
    st.lists(st.floats(-30, 30), min_size=2, max_size=80),
    st.lists(st.floats(-80, 80), min_size=80, max_size=80),
    st.floats(0, 6.3),
)
def test_the_crossings_of_any_walk_are_its_changes_of_side_beyond_the_margin(across, along, angle):
    """The oracle knows only the distances from a line that is long enough: an object that is more
    than the margin of 2 pixels beyond it, and was not when it was clear of it last, has crossed."""
    line = _long_line(angle)
    normal, direction = (-math.sin(angle), math.cos(angle)), (math.cos(angle), math.sin(angle))
    way = [
        (a * normal[0] + b * direction[0], a * normal[1] + b * direction[1])
        for a, b in zip(across, along, strict=False)
    ]
    events = TrackEvents(rules(lines_=line))
    found = crossings(walk(events, way))
    clear = [a for a in across if abs(a) > 2.001]
    if any(1.999 <= abs(a) <= 2.001 or abs(a) < 1e-6 for a in across):
        return  # too close to say, with rounded coordinates
    sides = [across[0] > 0, *(a > 0 for a in clear)]
    expected = [
        "right" if after else "left" for before, after in pairwise(sides) if before != after
    ]
    assert found == expected
    assert all(first != second for first, second in pairwise(found))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rate_hz", [5, 10, 30])
def test_a_jittering_passage_is_one_crossing_at_every_rate_and_within_20_ms(seed: int, rate_hz):
    """50 pixels/s over x = 100 at 2 s; positions are wrong by up to 0.8 pixels, so the time by at
    most 0.8 / 50 s = 16 ms. Steps of 1.7 pixels at 30 Hz go back and forth near the line."""
    noise = random.Random(seed)
    events = gate()
    found = []
    for frame in range(4 * rate_hz):
        time_s = frame / rate_hz
        x = 50 * time_s + noise.uniform(-0.8, 0.8)
        found += events.update([track(x, 100)], round(time_s * 1e9))
    (crossing,) = [event for event in found if event.kind == "line_crossed"]
    assert crossing.at.stamp_ns == pytest.approx(2e9, abs=20e6)


def _long_line(angle: float) -> str:
    """Return a line of 20,000 pixels through (0, 0)."""
    x, y = 10_000 * math.cos(angle), 10_000 * math.sin(angle)
    return f"gate {-x:.9f},{-y:.9f} {x:.9f},{y:.9f}"
