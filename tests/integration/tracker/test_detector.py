"""The tracker with a model: boxes with classes on the wire, for one camera and for several."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.support import detector_models
from tests.support.detector_models import scene
from tests.support.listening import Listener, newest, wait_for_nodes
from tests.support.publishing import PlainCamera, wait_for_subscriber
from tests.support.waiting import wait_until
from zenoh_vision.image.codecs import encode_jpeg

SIZE = (320, 240)


def walk(number: int, count: int = 40) -> tuple[bytes, ...]:
    """Return JPEGs on which a box of a class moves to the right, 4 pixels a picture."""
    boxes = [{number: (20 + 4 * step, 60, 60 + 4 * step, 140)} for step in range(count)]
    return tuple(encode_jpeg(scene(each, SIZE), "bgr8", 95) for each in boxes)


def detector(service, tmp_path: Path, *flags: object, layout: str = "yolov8", **model: object):
    path = detector_models.save(tmp_path / "tiny.onnx", layout, **model)
    return service("tracker", "--pipeline", "detector", "--model", path, *flags)


def message(client, node: str) -> str:
    """Return what a node says in its health."""
    return str(newest(client, f"@vision/diagnostics/{node}").body["message"])


def test_tracks_and_events_say_class_and_score_and_boxes_are_those_of_their_frame(
    service, client, tmp_path: Path
):
    detector(service, tmp_path, "--zones", "all 0,0 320,0 320,240 0,240")
    wait_for_nodes(client, "tracker_front")
    tracks, events = (
        Listener(client, "vision/front/tracks"),
        Listener(client, "vision/front/events"),
    )
    camera = PlainCamera(client, pictures=walk(1))
    wait_for_subscriber(client, "vision/front/image/compressed")
    for number in range(12):
        camera.send()
        wait_until(lambda number=number: len(tracks.messages) > number)
    for message in tracks.messages[4:]:
        [track] = message.body["tracks"]
        assert (track["class"], track["state"]) == ("green", "confirmed")
        assert track["score"] == pytest.approx(0.8, abs=0.01)
        left = 20 + 4 * message.header["seq"]
        # An input of 64 pixels shows 320, so a side is right within 5 pixels.
        assert track["box"][0] == pytest.approx(left, abs=5)
        assert track["box"][2] == pytest.approx(40, abs=6)
    wait_until(lambda: any(each.body["event"] == "zone_entered" for each in events.messages))
    assert {each.body["class"] for each in events.messages} == {"green"}
    assert all(each.body["score"] > 0.7 for each in events.messages)
    report = newest(client, "@vision/diagnostics/tracker_front").body
    assert report["counters"]["model_frames"] == 12
    assert report["counters"]["received"] == report["counters"]["processed"] == 12
    description = newest(client, "@vision/node/tracker_front").body
    assert description["pipeline"] == "detector"


def test_only_wanted_classes_are_tracked_and_the_choice_is_live(service, client, tmp_path: Path):
    detector(service, tmp_path, "--classes", "red, blue")
    wait_for_nodes(client, "tracker_front")
    tracks = Listener(client, "vision/front/tracks")
    with PlainCamera(client, pictures=walk(1)).at(15):
        wait_until(lambda: len(tracks.messages) > 5)
        assert not any(each.body["tracks"] for each in tracks.messages)
        client.get("@vision/set/tracker_front/classes", payload=b"\xa5green")
        wait_until(lambda: tracks.messages[-1].body["tracks"])
    assert tracks.messages[-1].body["tracks"][0]["class"] == "green"


def test_several_cameras_share_a_model_that_is_slower_than_they_are(
    service, client, tmp_path: Path
):
    """Each gets its share, the frames are new, and what came meanwhile counts as overwritten."""
    names = {"door": 0, "yard": 1, "gate": 2}
    detector(service, tmp_path, "--camera", ",".join(names), "--model-threads", 1, takes_s=0.05)
    wait_for_nodes(client, "tracker")
    listeners = {name: Listener(client, f"vision/{name}/tracks") for name in names}

    def counts() -> list[int]:
        return [len(each.messages) for each in listeners.values()]

    with ExitStack() as running:
        for name, number in names.items():
            pictures = walk(number)
            running.enter_context(PlainCamera(client, camera=name, pictures=pictures).at(40))
        wait_until(lambda: all(len(each.messages) > 3 for each in listeners.values()))
        wait_until(lambda: "waiting" in message(client, "tracker"))
        # The cameras did not start at the same moment: what counts is what comes from now on.
        before = counts()
        wait_until(lambda: sum(counts()) - sum(before) > 30)
    since = [now - then for now, then in zip(counts(), before, strict=True)]
    assert max(since) < 2 * min(since)
    colours = {
        name: {track["class"] for each in listener.messages for track in each.body["tracks"]}
        for name, listener in listeners.items()
    }
    assert colours == {"door": {"red"}, "yard": {"green"}, "gate": {"blue"}}
    counters = newest(client, "@vision/diagnostics/tracker").body["counters"]
    dropped = sum(count for name, count in counters.items() if name.startswith("dropped."))
    assert counters["dropped.overwritten"] > 0
    assert counters["received"] == counters["processed"] + dropped + counters["pending"]


@pytest.mark.quiet
def test_frames_do_not_wait_for_a_model_that_takes_seconds(service, client, tmp_path: Path):
    tracker = detector(service, tmp_path, "--model-threads", "1", takes_s=2.0)
    wait_for_nodes(client, "tracker_front", deadline_s=60)
    tracks = Listener(client, "vision/front/tracks")
    with PlainCamera(client, pictures=walk(1)).at(15):
        wait_until(lambda: len(tracks.messages) > 30)
        said = "frames do not wait for it"
        wait_until(
            lambda: said in message(client, "tracker_front"),
            60,
            lambda: message(client, "tracker_front"),
        )
        seqs = [each.header["seq"] for each in tracks.messages]
        assert seqs == sorted(set(seqs))
        begun_s = time.monotonic()
        tracker.process.terminate()
        assert tracker.process.wait(5) == 0
        assert time.monotonic() - begun_s < 2.0


def test_on_motion_the_model_rests_while_nothing_moves(service, client, tmp_path: Path):
    detector(service, tmp_path, "--on-motion")
    wait_for_nodes(client, "tracker_front")
    tracks = Listener(client, "vision/front/tracks")
    empty = encode_jpeg(scene({}, SIZE), "bgr8", 95)

    def model_frames() -> int:
        """Return the number in a report that is made from now on."""
        now_ns = time.time_ns()

        def report() -> dict[str, Any] | None:
            body = newest(client, "@vision/diagnostics/tracker_front").body
            return body if body["stamp_ns"] > now_ns else None

        return int(wait_until(report)["counters"].get("model_frames", 0))

    camera = PlainCamera(client, pictures=(empty,))
    with camera.at(20):
        wait_until(lambda: len(tracks.messages) > 60)
    rested, sent = model_frames(), len(tracks.messages)
    assert rested < 30
    for picture in walk(1):
        camera.send(picture)
        time.sleep(0.05)
    wait_until(lambda: model_frames() > rested + 10)
    classes = {track["class"] for each in tracks.messages[sent:] for track in each.body["tracks"]}
    assert classes == {"green"}


@pytest.mark.parametrize(
    ("flags", "status", "words"),
    [
        (["--pipeline", "detector"], 2, "pipeline = detector needs model"),
        (["--pipeline", "detector", "--model", "none.onnx"], 3, "none.onnx: No such file"),
        (["--pipeline", "detector", "--model", __file__], 3, "no complete ONNX model"),
    ],
)
def test_a_model_that_cannot_be_used_ends_the_tracker_with_a_clear_error(
    service, flags: list[str], status: int, words: str
):
    program = service("tracker", *flags)
    assert program.process.wait(20) == status
    assert words in program.complaints
