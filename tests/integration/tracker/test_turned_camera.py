"""A camera that is rotated while a tracker counts objects in a zone."""

from __future__ import annotations

import msgpack
import zenoh

from tests.support.listening import Listener, newest, wait_for_nodes
from tests.support.processes import START_S
from tests.support.waiting import wait_until

ZONE, TURNED = "left 0,0 320,0 320,480 0,480", "left 480,0 480,320 0,320 0,0"
"""The left half of the picture of 640x480; then x = 480 - y, y = x."""
SIZE = ("--width", 640, "--height", 480)


def rotate(client: zenoh.Session, degrees: int) -> None:
    payload = msgpack.packb(degrees)
    (reply,) = client.get("@vision/set/camera_front/rotate", payload=payload, timeout=10.0)
    assert reply.ok is not None


def zones(client: zenoh.Session) -> str:
    return newest(client, "@vision/param/tracker_front/zones").body["value"]


def test_zones_turn_with_the_camera_and_those_of_a_tracker_that_starts_again_too(client, service):
    listener = Listener(client, "vision/front/tracks")
    service("camera", "--rate", 20, *SIZE)
    tracker = service("tracker", "--zones", ZONE)
    wait_for_nodes(client, "camera_front", "tracker_front")
    listener.wait_for(3, START_S)
    assert zones(client) == ZONE
    rotate(client, 90)
    wait_until(lambda: listener.messages[-1].header.get("rotated") == 90)
    assert zones(client) == TURNED
    turned = [each for each in listener.messages if "rotated" in each.header]
    assert {(each.header["width"], each.header["height"]) for each in turned} == {(480, 640)}
    assert {each.header["revision"] for each in turned} == {1}, "from the first frame on"
    assert tracker.interrupt() == 0
    tracker = service("tracker", "--zones", ZONE)
    wait_until(lambda: zones(client) == TURNED)
    rotate(client, 0)
    wait_until(lambda: zones(client) == ZONE)


def test_a_tracker_of_several_cameras_says_which_zones_are_not_turned(client, service):
    service("camera", "--rate", 20, *SIZE)
    service("tracker", "--camera", "front,rear", "--zones", ZONE)
    wait_for_nodes(client, "camera_front", "tracker")
    rotate(client, 180)
    health = Listener(client, "@vision/diagnostics/tracker")
    wait_until(
        lambda: (
            health.messages and "zones left are not turned" in health.messages[-1].body["message"]
        )
    )
    assert health.messages[-1].body["level"] == 1
    rotate(client, 0)
    wait_until(lambda: "zones" not in health.messages[-1].body["message"])
