"""From pictures to events: the tracker publishes what happens in front of a camera."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.listening import Listener, wait_for_nodes
from tests.support.publishing import PlainCamera, wait_for_subscriber

RATE_HZ = 20
SPEED = 120  # pixels per second
SIDE = 40
STILL_S = 1.5
LINE_X = 160


def picture(at_s: float) -> bytes:
    """Return a room, through which a textured square goes to the right after a while."""
    noise = np.random.default_rng(5)
    room = noise.integers(90, 110, (240, 320, 3)).astype(np.uint8)
    left = round(SPEED * (at_s - STILL_S)) - SIDE
    square = noise.integers(180, 255, (SIDE, SIDE, 3)).astype(np.uint8)
    begin, end = max(0, left), min(320, left + SIDE)
    if begin < end:
        room[100 : 100 + SIDE, begin:end] = square[:, begin - left : end - left]
    return cv2.imencode(".jpg", room, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


def test_a_square_that_crosses_a_line_and_a_zone_has_each_event_once(client, lossless_service):
    """Its centre is at x = 120 (t - 1.5) - 20: on the line x = 160 at 3 s."""
    shapes = (
        "--lines",
        f"gate {LINE_X},0 {LINE_X},240",
        "--zones",
        "end 200,0 320,0 320,240 200,240",
    )
    lossless_service("tracker", "--max-age", 30, *shapes)  # however busy the machine is
    wait_for_nodes(client, "tracker_front")
    events, tracks = (Listener(client, f"vision/front/{name}") for name in ("events", "tracks"))
    camera = PlainCamera(client)
    wait_for_subscriber(client, "vision/front/image/compressed")
    frames = int((STILL_S + 3.2) * RATE_HZ)
    for frame in range(frames):
        stamp_ns = camera.epoch + round(frame / RATE_HZ * 1e9)
        camera.send(picture(frame / RATE_HZ), stamp_ns=stamp_ns)
        tracks.wait_for(frame + 1)  # the tracker is not hurried
    found = [each.body for each in events.messages]
    (crossed,) = [each for each in found if each["event"] == "line_crossed"]
    # Seen from (160, 0) to (160, 240), downwards, the larger x are on the left.
    assert (crossed["zone"], crossed["direction"], crossed["count"]) == ("gate", "left", 1)
    assert (crossed["stamp_ns"] - camera.epoch) / 1e9 == pytest.approx(3.0, abs=0.04)
    assert crossed["y"] == pytest.approx(120, abs=3)
    stays = [each["event"] for each in found if each["event"].startswith("zone")]
    assert stays[0] == "zone_entered"
    assert stays.count("zone_entered") == 1
    started = [each["id"] for each in found if each["event"] == "started"]
    assert started == [crossed["id"]]
    last = tracks.messages[-1].body
    assert last["lines"] == {"gate": {"left": 1, "right": 0}}
    assert last["zones"]["end"]["entered"] == 1
