"""What the tracker knows of a camera ends by time when the camera is killed."""

from __future__ import annotations

from tests.support.listening import Listener, newest, wait_for_nodes
from tests.support.waiting import wait_until


def test_tracks_and_zone_counts_end_when_the_camera_is_killed(service, client):
    """They end after ``keep_lost`` and 3 s, though no frame comes that could end them."""
    zone = "all 0,0 320,0 320,240 0,240"
    service("tracker", "--zones", zone, "--keep-lost", 0.2)
    wait_for_nodes(client, "tracker_front")
    events, tracks = (Listener(client, f"vision/front/{name}") for name in ("events", "tracks"))
    camera = service("camera", "--width", 320, "--height", 240, "--rate", 15)

    def inside() -> bool:
        messages = tracks.messages
        return bool(messages) and messages[-1].body["zones"]["all"]["inside"] > 0

    wait_until(inside)
    camera.process.kill()
    wait_until(lambda: tracks.messages[-1].body["tracks"] == [])
    last, before = tracks.messages[-1].body, tracks.messages[-2].body
    assert last["header"]["seq"] == before["header"]["seq"]
    assert (before["zones"]["all"]["inside"] > 0, last["zones"]["all"]["inside"]) == (True, 0)
    assert last["zones"]["all"]["entered"] == last["zones"]["all"]["left"]
    found = [each.body["event"] for each in events.messages]
    assert found.count("started") == found.count("ended")
    assert found.count("zone_entered") == found.count("zone_left")
    assert newest(client, "vision/front/tracks").body["tracks"] == []
