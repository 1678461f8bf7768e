"""Tracks start, are confirmed, lost, found again, and end: each once, with its stamp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from tests.support.track_walks import STEP_NS, crossings, kinds, rules, track, walk
from zv.tracker.events.track_events import EventRules, TrackEvents


def told(found) -> list[tuple[str, int, int]]:
    return [(event.kind, event.id, event.at.stamp_ns // 1_000_000) for event in found]


def test_a_confirmed_track_has_each_event_of_its_life_once():
    events = TrackEvents(EventRules())
    found = []
    states = ["tentative", "tentative", "confirmed", "confirmed", "lost", "lost", "confirmed"]
    for number, state in enumerate(states):
        one = track(5 * number, 50, state=state, missing_s=0.1 * (state == "lost"))
        found += events.update([one], number * STEP_NS)
    found += events.update([], 7 * STEP_NS)
    assert told(found) == [
        ("started", 1, 0),  # where it was seen first
        ("confirmed", 1, 200),
        ("lost", 1, 300),  # where it was seen last
        ("confirmed", 1, 600),
        ("ended", 1, 600),
    ]
    assert [event.at.pixel[0] for event in found] == [0, 10, 15, 30, 30]


def test_a_track_that_is_never_confirmed_has_no_events():
    events = TrackEvents(EventRules())
    assert events.update([track(5, 5, state="tentative")], 0) == []
    assert events.update([], STEP_NS) == []
    assert events.end() == []


def test_a_new_epoch_ends_all_tracks_and_the_same_id_is_another_track():
    events = TrackEvents(rules(lines_="gate 100,0 100,200"))
    walk(events, [(60, 50), (60, 50)], start=10)
    assert told(events.end()) == [("ended", 1, 1100)]
    found = walk(events, [(140, 50), (150, 50)])
    assert kinds(found) == ["started", "confirmed"]
    assert crossings(found) == []


def test_after_a_pause_the_same_id_continues_its_track_and_another_one_is_new():
    events = TrackEvents(rules(zones="belt 0,0 200,0 200,100 0,100", dwell_s=5.0))
    walk(events, [(50, 50)])
    found = events.update([track(60, 50)], 100 * STEP_NS)
    assert told(found) == [("zone_dwell", 1, 5000)]
    found = events.update([track(60, 50, id_=2)], 200 * STEP_NS)
    assert told(found) == [
        ("zone_left", 1, 10_000),
        ("ended", 1, 10_000),
        ("started", 2, 20_000),
        ("confirmed", 2, 20_000),
        ("zone_entered", 2, 20_000),
    ]


def test_an_hour_without_objects_has_no_events():
    events = TrackEvents(rules(zones="belt 0,0 200,0 200,100", lines_="gate 100,0 100,200"))
    assert [events.update([], second * 10**9) for second in range(3600)] == [[]] * 3600


def test_each_of_a_thousand_objects_has_its_events():
    events = TrackEvents(rules(lines_="gate 100,-9999 100,9999"))
    for number, x in enumerate((90, 110)):
        tracks = [track(x, 5 * id_, id_=id_) for id_ in range(1000)]
        found = events.update(tracks, number * STEP_NS)
    assert crossings(found) == ["left"] * 1000
    assert events.counts.lines["gate"].left == 1000
    assert kinds(events.update([], 2 * STEP_NS)) == ["ended"] * 1000


@dataclass(frozen=True)
class Plane:
    """A plane in which 100 pixels are one metre, up to y = 500: Y up as on a map, or down."""

    metre: float = 100.0
    up: bool = True

    @property
    def mirrored(self) -> bool:
        return self.up

    def positions(self, points: np.ndarray) -> np.ndarray:
        found = points / (self.metre, -self.metre if self.up else self.metre)
        found[points[:, 1] > 500] = np.nan
        return found


def test_shapes_in_world_units_use_the_position_on_the_plane():
    # Up along X = 1 m: going right in the picture goes to the right of it.
    wanted = rules(zones="pick world 0.5,-0.9 2,-0.9 2,-0.1 0.5,-0.1", lines_="in world 1,-2 1,2")
    events = TrackEvents(wanted)
    found = []
    for number, x in enumerate((40, 60, 140)):
        found += events.update([track(x, 50)], number * STEP_NS, Plane())
    shaped = [event for event in found if event.shape]
    assert [(event.kind, event.shape) for event in shaped] == [
        ("zone_entered", "pick"),
        ("line_crossed", "in"),
    ]
    assert shaped[1].direction == "right"
    # The plane counts from the middle of the first pixel, tracks from its edge: X = 1 is at 100.5,
    # of 80 pixels in 0.1 s the 40.5th.
    assert shaped[1].at.stamp_ns == pytest.approx(150_625_000, abs=1)
    assert shaped[0].at.world == pytest.approx((0.5, -0.495))
    assert shaped[1].at.world == pytest.approx((1.0, -0.495))
    assert shaped[1].at.pixel == pytest.approx((100.5, 50))


@pytest.mark.parametrize(
    ("up", "line"), [(True, "world 1,-2 1,0"), (False, "world 1,2 1,0")], ids=["Y up", "Y down"]
)
def test_a_pixel_line_and_the_same_line_in_world_units_have_the_same_directions(
    up: bool, line: str
):
    wanted = rules(lines_=f"a 100,200 100,0; b {line}")
    events = TrackEvents(wanted)
    found = []
    for number, x in enumerate((60, 140, 60)):
        found += events.update([track(x, 50)], number * STEP_NS, Plane(up=up))
    assert crossings(found) == ["right", "right", "left", "left"]


@pytest.mark.parametrize("up", [True, False], ids=["Y up", "Y down"])
def test_an_object_that_stops_on_a_world_line_and_goes_on_crosses_it_once(
    up: bool,
):
    events = TrackEvents(rules(lines_=f"in world {'1,-2 1,0' if up else '1,2 1,0'}"))
    found = []
    for number, x in enumerate((60, 100, 140, 100, 60)):
        found += events.update([track(x, 50)], number * STEP_NS, Plane(up=up))
    assert crossings(found) == ["right", "left"]


def test_the_margin_of_a_world_line_is_that_of_the_picture():
    """2 pixels are 2 cm: jitter of 1.9 cm on the line is no crossing."""
    events = TrackEvents(rules(lines_="in world 1,-2 1,2"))
    found = []
    for number in range(30):
        x = 60 if number == 0 else 100 + (-1) ** number * 1.9
        found += events.update([track(x, 50)], number * STEP_NS, Plane())
    assert crossings(found) == []
    assert crossings(events.update([track(103, 50)], 30 * STEP_NS, Plane())) == ["right"]


def test_shapes_in_world_units_have_no_events_without_a_calibration_or_beyond_the_horizon():
    events = TrackEvents(rules(lines_="in world 1,-20 1,20"))
    assert crossings(walk(events, [(60, 50), (140, 50)], end=True)) == []
    events, found = TrackEvents(events.rules), []
    for number, (x, y) in enumerate(((60, 50), (60, 600), (140, 600), (140, 50))):
        found += events.update([track(x, y)], number * STEP_NS, Plane())
    # One crossing, between the two positions that are on the plane.
    stamps_ns = [event.at.stamp_ns for event in found if event.shape]
    assert stamps_ns == pytest.approx([151_875_000], abs=1)  # X = 1 is at 100.5: 40.5 of 80


def test_a_change_of_the_calibration_is_not_a_crossing():
    events = TrackEvents(rules(lines_="in world 1,-20 1,20; gate 1,0 1,500"))
    events.update([track(60, 50)], 0, Plane())
    moved = events.update([track(60, 50)], STEP_NS, Plane(10.0))
    assert crossings(moved) == []
