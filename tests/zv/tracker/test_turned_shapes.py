"""Zones, lines and regions of a tracker while the camera is rotated and mirrored."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tests.support.headers import header
from tests.support.track_walks import track
from zenoh_vision import Frame, Node
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.image.turn import Turn
from zv.tracker import shapes
from zv.tracker.events.track_events import EventRules, TrackEvents
from zv.tracker.settings import TrackerSettings
from zv.tracker.turned_shapes import TurnedShapes, turned

ZONES = "belt 10,10 30,10 30,20 10,20  # the new one; or not\nhall world 0,0 1,0 1,1"
RIGHT = "belt 38,10 38,30 28,30 28,10  # the new one; or not\nhall world 0,0 1,0 1,1"
"""The same in the picture of 64x48 that is rotated by 90 degrees: x = 48 - y, y = x."""


class Watched(Node):
    """A node that is not open, and keeps what is reported and published."""

    def __init__(self, settings: TrackerSettings) -> None:
        self.live = ParameterStore(settings)
        super().__init__("tracker", camera=settings.cameras, parameters=self.live)
        self.reported: dict[str, str] = {}

    def report(self, condition: str, level: int, message: str = "") -> None:
        self.reported[condition] = message if level else ""

    def frame(self, **changes: object) -> Frame:
        about = header(**changes)
        found = Frame(about, np.zeros((about.height, about.width, 3), np.uint8))
        found.revision = self.live.activate()
        return found

    @property
    def zones(self) -> str:
        return self.live.newest.settings.zones


def started(**settings: object) -> tuple[Watched, TurnedShapes]:
    initial = TrackerSettings.model_validate({"zones": ZONES, **settings})
    node = Watched(initial)
    return node, TurnedShapes(node, "front", initial)


SIDEWAYS = {"width": 48, "height": 64}


def test_shapes_are_turned_with_the_picture_and_back():
    node, turning = started(lines="gate 5,0 5,48", regions="all 0,0 64,0 64,48", ignore="")
    turning.follow(node.frame())
    assert node.live.newest.number == 0
    frame = node.frame(rotated=90, **SIDEWAYS)
    turning.follow(frame)
    assert node.zones == RIGHT
    assert frame.revision.settings.zones == RIGHT, "the frame itself is tracked with them"
    after = node.live.newest.settings
    assert (after.lines, after.regions, after.ignore) == (
        "gate 48,5 0,5",
        "all 48,0 48,64 0,64",
        "",
    )
    turning.follow(node.frame(rotated=90, seq=1, **SIDEWAYS))
    assert node.live.newest.number == 1
    turning.follow(node.frame(seq=2))
    assert node.live.newest.settings == frame.revision.settings.model_copy(
        update={"zones": ZONES, "lines": "gate 5,0 5,48", "regions": "all 0,0 64,0 64,48"}
    )
    assert not any(node.reported.values())


def test_a_tracker_that_is_started_again_turns_the_zones_of_its_start():
    node, turning = started()
    turning.follow(node.frame(rotated=90, **SIDEWAYS))
    assert node.zones == RIGHT


def test_a_zone_that_is_drawn_in_the_turned_picture_is_for_that():
    node, turning = started()
    turning.follow(node.frame(rotated=90, **SIDEWAYS))
    node.live.change({"zones": "door 0,0 48,0 48,10"})
    turning.follow(node.frame(rotated=90, **SIDEWAYS))
    assert node.zones == "door 0,0 48,0 48,10"
    turning.follow(node.frame(rotated=180))
    assert node.zones == "door 64,0 64,48 54,48"  # x = 64 - y, y = x


def test_with_several_cameras_the_health_names_the_shapes_until_they_are_set_again():
    node, turning = started(camera="front,left", lines="gate 5,0 5,48")
    turning.follow(node.frame(rotated=180))
    assert node.zones == ZONES
    assert node.reported == {
        "shapes of front": "front: the picture is rotated by 180 degrees, but zones belt and lines "
        "gate are not turned with it, since they are also those of other cameras: set them again, "
        "or set rotate and flip of the camera back"
    }
    node.live.change({"zones": RIGHT})
    turning.follow(node.frame(rotated=180))
    assert "but lines gate are" in node.reported["shapes of front"]
    node.live.change({"lines": ""})
    turning.follow(node.frame(rotated=180))
    assert node.reported == {"shapes of front": ""}


def test_a_part_of_the_picture_that_does_not_turn_with_it_is_reported_until_it_is_turned_back():
    node, turning = started()
    turning.follow(node.frame())
    turning.follow(node.frame(rotated=90))  # still 64x48: a region
    assert node.zones == ZONES
    assert "the camera has a region" in node.reported["shapes of front"]
    turning.follow(node.frame())
    assert node.reported == {"shapes of front": ""}


def test_a_text_that_is_too_long_when_it_is_turned_is_reported():
    node, turning = started(zones="belt 1,1 2,1 2,2".ljust(shapes.MAX_CHARACTERS, "\n"))
    turning.follow(node.frame(rotated=180))
    assert "characters" in node.reported["shapes of front"]


@pytest.mark.parametrize(
    ("degrees", "mirrored"), list(product((0, 90, 180, 270), (False, True)))[1:]
)
def test_an_object_has_the_same_events_in_each_orientation(degrees: int, mirrored: bool):
    zones, lines = "belt 20,10 40,10 40,40 20,40", "gate 30,0 32,48"

    def events(zones: str, lines: str, turn: Turn) -> list[tuple[object, ...]]:
        found = TrackEvents(EventRules(shapes.polygons(zones), shapes.lines(lines)))
        walk = [turn.point(x, 25, (64, 48)) for x in range(5, 60, 4)]
        seen = [found.update([track(x, y)], at * 10**8) for at, (x, y) in enumerate(walk)]
        return [
            (event.kind, event.shape, event.direction, event.at.stamp_ns)
            for each in seen
            for event in each
        ]

    turn = Turn(degrees, mirrored)
    before = events(zones, lines, Turn())
    assert [each[0] for each in before][2:] == ["zone_entered", "line_crossed", "zone_left"]
    texts = (
        turned(name, text, turn, (64, 48)) for name, text in (("zones", zones), ("lines", lines))
    )
    assert events(*texts, turn) == before
