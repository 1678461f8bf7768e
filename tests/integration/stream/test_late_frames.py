"""A stream of which every frame comes too late is reported as such, until one is in time."""

from __future__ import annotations

import time

from tests.support.listening import Listener, balance, wait_for_nodes
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until
from zenoh_vision.messages import Level

KEY = "vision/front/image/compressed"
RATE_HZ = 20
TURNED_NS = 3600 * 10**9  # the camera's clock is off by an hour, which makes no frame late
LATER_NS = 10**9  # how much longer than before each frame is on its way; 0.4 s is allowed


def test_frames_that_all_come_too_late_are_reported_until_one_is_in_time(client, quick_service):
    quick_service("tracker")
    wait_for_nodes(client, "tracker_front")
    health = Listener(client, "@vision/diagnostics/tracker_front")
    centroids = Listener(client, "vision/front/centroid")
    camera = PlainCamera(client)

    def send(later_ns: int = 0) -> None:
        camera.send(stamp_ns=time.time_ns() - TURNED_NS - later_ns)

    with camera.at(RATE_HZ, send):
        centroids.wait_for(10)
    before_s = time.monotonic()
    # The stamps go on from the last one: so it is no clock that was set back in one step.
    wait_until(lambda: time.monotonic() > before_s + LATER_NS / 1e9)
    late_from, late_s = camera.seq, time.monotonic()
    with camera.at(RATE_HZ, lambda: send(LATER_NS)):
        told = wait_until(lambda: about_lateness(health))
    assert told[0].at_s - late_s > 2  # a queue that drains is late for a moment, which is normal
    assert told[0].body["level"] == Level.WARN
    assert KEY in told[0].body["message"]
    assert "no frame on" not in told[0].body["message"]
    assert told[0].body["counters"]["dropped.stale"] > 1
    assert not [m for m in centroids.messages if m.header["seq"] >= late_from]

    fresh_from, fresh_s = camera.seq, time.monotonic()
    with camera.at(RATE_HZ, send):
        first = centroids.wait_for(1, after_s=fresh_s)[0]
        # A busy machine may make one more frame late.
        reports = wait_until(lambda: all_well(made_after(health, first.header["done_ns"], 2)[-2:]))
    assert first.header["seq"] >= fresh_from
    assert balance(reports[-1].body["counters"]) == 0


def about_lateness(health: Listener) -> list:
    return [message for message in health.messages if "came too late" in message.body["message"]]


def made_after(health: Listener, time_ns: int, count: int) -> list:
    found = [message for message in health.messages if message.body["stamp_ns"] > time_ns]
    return found if len(found) >= count else []


def all_well(reports: list) -> list:
    return reports if {report.body["level"] for report in reports} == {Level.OK} else []


def test_a_stream_that_ends_late_is_silent_not_late(client, quick_service):
    quick_service("tracker")
    wait_for_nodes(client, "tracker_front")
    health = Listener(client, "@vision/diagnostics/tracker_front")
    centroids = Listener(client, "vision/front/centroid")
    camera = PlainCamera(client)
    with camera.at(RATE_HZ):
        centroids.wait_for(10)
    ended_ns = time.time_ns()
    end_s = time.monotonic()
    wait_until(lambda: time.monotonic() > end_s + LATER_NS / 1e9)
    camera.send(stamp_ns=ended_ns)
    last = wait_until(lambda: [m for m in health.messages if "no frame on" in m.body["message"]])[0]
    assert last.body["counters"]["dropped.stale"] == 1
    assert not about_lateness(health)
