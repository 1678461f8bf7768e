"""Objects enter a zone, stay in it and leave it, each reported once."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.track_walks import STEP_NS, kinds, rules, track, walk
from zv.tracker.events.track_events import TrackEvents

BELT = "belt 100,0 200,0 200,100 100,100"


def belt(**changes) -> TrackEvents:
    return TrackEvents(rules(zones=BELT, **changes))


def stays(found) -> list[tuple[str, int]]:
    """Return the kinds of a zone's events with their stamps in ms."""
    return [(event.kind, event.at.stamp_ns // 1_000_000) for event in found if event.shape]


def test_entering_and_leaving_have_the_time_and_position_at_the_edge():
    found = walk(belt(), [(80, 50), (120, 60), (150, 60), (250, 50)])
    # In from x = 80 at 0 ms to 120 at 100 ms: the edge x = 100 half way. Out from x = 150 at
    # 200 ms to 250 at 300 ms: the edge x = 200 half way.
    assert stays(found) == [("zone_entered", 50), ("zone_left", 250)]
    entered, left = (event for event in found if event.shape)
    assert (entered.at.pixel, left.at.pixel) == ((100, 55), (200, 55))
    assert (entered.shape, entered.count, entered.inside) == ("belt", 1, 1)
    assert (left.shape, left.count, left.inside, left.dwell_s) == ("belt", 1, 0, 0.2)


def test_an_object_first_seen_inside_enters_at_that_time():
    assert stays(walk(belt(), [(150, 50), (150, 50)])) == [("zone_entered", 0)]


def test_an_object_that_jitters_on_the_edge_has_one_stay():
    way = [(80, 50), *[(100 + (-1) ** i * 1.9, 50) for i in range(30)], (80, 50)]
    assert kinds(walk(belt(), way), "zone_entered", "zone_left") == ["zone_entered", "zone_left"]


def test_a_zone_smaller_than_the_margin_is_entered_too():
    events = TrackEvents(rules(zones="dot 100,100 101,100 101,101 100,101"))
    found = walk(events, [(80, 100.5), (100.5, 100.5), (120, 100.5)])
    assert kinds(found, "zone_entered", "zone_left") == ["zone_entered", "zone_left"]


def test_a_long_stay_is_reported_once_with_the_time_of_its_threshold():
    found = walk(belt(dwell_s=0.25), [(150, 50)] * 20)
    assert stays(found) == [("zone_entered", 0), ("zone_dwell", 250)]
    assert [event.dwell_s for event in found if event.kind == "zone_dwell"] == [0.25]


def test_each_long_stay_of_an_object_is_reported():
    way = [*[(150, 50)] * 4, (250, 50), *[(150, 50)] * 4, (250, 50)]
    found = walk(belt(dwell_s=0.2), way)
    assert kinds(found, "zone_dwell", "zone_left") == ["zone_dwell", "zone_left"] * 2


def test_a_stay_that_ended_too_early_between_two_frames_was_not_long():
    """In the zone from 0 to 150 ms, where the step from 100 to 200 ms goes through the edge."""
    found = walk(belt(dwell_s=0.18), [(150, 50), (150, 50), (250, 50)])
    assert stays(found) == [("zone_entered", 0), ("zone_left", 150)]


def test_an_object_lost_in_the_zone_leaves_it_when_its_track_ends():
    events = belt()
    found = walk(events, [(150, 50), (160, 50)])
    for number in (2, 3):
        lost = track(250, 50, state="lost", missing_s=0.1)
        found += events.update([lost], number * STEP_NS)
    assert events.counts.zones["belt"].inside == 1
    found += events.update([], 4 * STEP_NS)
    # It was seen last at 100 ms.
    assert [
        (event.kind, event.at.stamp_ns // 1_000_000)
        for event in found
        if event.kind not in ("started", "confirmed")
    ] == [
        ("zone_entered", 0),
        ("lost", 100),
        ("zone_left", 100),
        ("ended", 100),
    ]
    assert events.counts.zones["belt"].inside == 0


def test_two_objects_are_counted_separately():
    events = belt()
    found = []
    for number, xs in enumerate([(90, 95), (110, 115), (150, 190), (160, 250)]):
        tracks = [track(x, 50, id_=id_) for id_, x in enumerate(xs, 1)]
        found += events.update(tracks, number * STEP_NS)
    assert [(event.kind, event.id, event.inside) for event in found if event.shape] == [
        ("zone_entered", 1, 1),
        ("zone_entered", 2, 2),
        ("zone_left", 2, 1),
    ]
    count = events.counts.zones["belt"]
    assert (count.entered, count.left, count.inside) == (2, 1, 1)


def test_a_track_that_is_never_confirmed_has_no_stay():
    events = belt()
    found = [
        event
        for number, x in enumerate((150, 150, 250))
        for event in events.update([track(x, 50, state="tentative")], number * STEP_NS)
    ]
    found += events.update([], 3 * STEP_NS)
    assert found == []
    assert events.counts.zones["belt"].inside == 0


def unconfirmed(events: TrackEvents, way: Sequence[tuple[float, float]]) -> None:
    """Walk this way before being confirmed, which is no event."""
    for number, (x, y) in enumerate(way):
        assert events.update([track(x, y, state="tentative")], number * STEP_NS) == []


def test_a_stay_that_ended_before_confirmation_is_reported_once_at_confirmation():
    events = belt(dwell_s=0.15)
    # In from x = 80 to 120: half way at 50 ms. Out from x = 180 at 300 ms to 220: at 350 ms.
    unconfirmed(events, [(80, 50), (120, 50), (150, 50), (180, 50), (220, 50)])
    found = walk(events, [(230, 50), (240, 50)], start=5, end=True)
    assert stays(found) == [("zone_entered", 50), ("zone_dwell", 200), ("zone_left", 350)]
    assert kinds(found)[:2] == ["started", "zone_entered"]
    assert [event.inside for event in found if event.shape] == [1, 1, 0]
    assert [event.dwell_s for event in found if event.kind == "zone_left"] == [0.3]
    count = events.counts.zones["belt"]
    assert (count.entered, count.left, count.dwelled, count.inside) == (1, 1, 1, 0)


def test_all_stays_before_confirmation_are_reported_including_the_current_one():
    events = belt()
    unconfirmed(events, [(150, 50), (250, 50), (150, 50), (250, 50), (150, 50)])
    found = walk(events, [(150, 50), (160, 50)], start=5)
    assert stays(found) == [
        ("zone_entered", 0),
        ("zone_left", 50),
        ("zone_entered", 150),
        ("zone_left", 250),
        ("zone_entered", 350),
    ]
    assert events.counts.zones["belt"].inside == 1


def test_moving_a_zone_ends_its_stays_and_begins_those_at_its_new_place():
    events = belt()
    walk(events, [(110, 50), (110, 50)])
    events.adjust(rules(zones="belt 105,0 200,0 200,100 105,100"))
    found = walk(events, [(110, 50)], start=2)
    assert [(event.kind, event.count, event.inside) for event in found] == [
        ("zone_left", 1, 0),
        ("zone_entered", 1, 1),
    ]


def test_an_unchanged_zone_keeps_its_stays_while_others_change():
    events = belt()
    walk(events, [(150, 50)])
    events.adjust(rules(zones=f"{BELT}; other 300,0 400,0 400,100", dwell_s=5.0))
    assert walk(events, [(150, 50)], start=1) == []
    assert events.counts.zones["belt"].inside == 1


def test_a_new_epoch_ends_the_stays_and_keeps_the_counts():
    events = belt()
    walk(events, [(150, 50), (150, 50)], start=10)
    assert kinds(events.end()) == ["zone_left", "ended"]
    # The new epoch's stamps may be earlier, and its ids are other objects.
    found = walk(events, [(150, 50)])
    assert stays(found) == [("zone_entered", 0)]
    assert [event.count for event in found if event.shape] == [2]


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(60, 240), st.integers(-40, 140)), max_size=60))
def test_the_stays_of_any_walk_are_those_found_by_comparing_coordinates(way):
    """The oracle of the square: inside it, or more than 2 pixels outside; between, as before."""
    way = [(x + 0.5, y + 0.5) for x, y in way]
    expected, inside = [], False
    for x, y in way:
        dx, dy = max(100 - x, 0, x - 200), max(0 - y, 0, y - 100)
        now = True if dx == dy == 0 else False if dx * dx + dy * dy > 4 else inside
        if now != inside:
            expected.append("zone_entered" if now else "zone_left")
        inside = now
    events = belt(dwell_s=1e6)
    found = walk(events, way)
    assert kinds(found, "zone_entered", "zone_left") == expected
    assert events.counts.zones["belt"].inside == int(inside)
    assert kinds(events.end(), "zone_left") == ["zone_left"] * inside
    stamps = [event.at.stamp_ns for event in found]
    assert all(0 <= stamp <= len(way) * STEP_NS for stamp in stamps)
