"""A picture that was reduced for a slow link keeps the coordinates of its frame for everybody."""

from __future__ import annotations

from tests.support.listening import Listener
from tests.support.waiting import wait_until
from zenoh_vision import Connection, Node
from zenoh_vision.image.codecs import picture_size

SIZE = (640, 480)


def is_reduced(pictures: Listener) -> bool:
    """Tell whether the newest picture is smaller than its frame."""
    return bool(pictures.messages) and picture_size(pictures.messages[-1].payload) != SIZE


def matched(tracks: list[dict], truths: list[dict]) -> list[float]:
    """Return how far each confirmed track is from the nearest true object, pixels."""
    return [
        min(abs(track["x"] - true["x"]) + abs(track["y"] - true["y"]) for true in truths)
        for track in tracks
        if track["state"] == "confirmed" and truths
    ]


def test_a_picture_that_was_reduced_moves_no_track(client, service):
    service("camera", "--width", SIZE[0], "--height", SIZE[1], "--max-kbps", 150)
    service("tracker", "--transport", "jpeg")
    pictures = Listener(client, "vision/front/image/compressed")
    tracks, truth = Listener(client, "vision/front/tracks"), Listener(client, "vision/front/truth")
    wait_until(lambda: is_reduced(pictures), 60)
    assert picture_size(pictures.messages[-1].payload) in ((320, 240), (160, 120))
    first = len(tracks.messages)
    header = pictures.messages[-1].header
    assert (header["width"], header["height"]) == SIZE

    def off() -> list[float]:
        true = {each.header["seq"]: each.body["tracks"] for each in truth.messages}
        return [
            distance
            for each in tracks.messages[first:]
            for distance in matched(each.body["tracks"], true.get(each.header["seq"], []))
        ]

    # Several seconds: the tracks of one moment are all wrong alike, while objects hide each other.
    distances = wait_until(lambda: found if len(found := off()) > 150 else None, 60, poll_s=0.2)
    assert sorted(distances)[len(distances) // 2] < 15
    sent = tracks.messages[-1].header
    assert (sent["width"], sent["height"]) == SIZE


def test_a_local_consumer_gets_the_full_size_while_the_watcher_gets_a_reduced_one(
    client, router, service
):
    service("camera", "--width", SIZE[0], "--height", SIZE[1], "--max-kbps", 150)
    pictures = Listener(client, "vision/front/image/compressed")
    with Node("taker", connection=Connection(router.endpoint, timeout_s=20)) as node:
        frames = node.frames()
        wait_until(lambda: is_reduced(pictures), 60)
        for frame in frames:
            assert frame.bgr.shape == (SIZE[1], SIZE[0], 3)
            if frames.route == "shm":
                assert not frame.is_reduced
                break
