"""``zv camera --lockstep``: a file is published frame by frame, as its consumers answer."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import zenoh

from tests.integration.conftest import Service
from tests.support.listening import Listener, wait_for_nodes
from tests.support.recordings import frames, write
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision import Centroid, Node, ParameterStore
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.image.picture import JpegPicture
from zenoh_vision.testing import at
from zv.camera.service import publish_all, topics
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import TimedPicture


def test_every_frame_of_a_recording_is_answered_once(
    client: zenoh.Session, service: Service, tmp_path: Path
):
    run = write(tmp_path / "run.mcap", frames(30))
    answers = Listener(client, "vision/front/centroid")
    service("tracker", "--camera", "front")
    camera = service("camera", "--source", run, "--lockstep", "tracker_front")
    wait_until(lambda: camera.process.poll() == 0, explain=lambda: camera.complaints)
    found = answers.wait_for(30)
    assert [each.header["seq"] for each in found] == list(range(30))
    assert "ended after 30 frames" in camera.complaints


class Leaving:
    """A source whose second frame comes when the node that answered the first has left."""

    rate_hz = None
    pictures = frames(2)

    def __init__(self, leave: Callable[[], None]) -> None:
        self._leave = leave
        self._next = 0

    def read(self) -> TimedPicture:
        if self._next == 1:
            self._leave()
        self._next += 1
        return TimedPicture(JpegPicture(self.pictures[self._next - 1].payload))

    def close(self) -> None:
        pass


def test_a_node_that_left_before_a_frame_was_sent_ends_it_and_the_frame_is_counted_once(
    router: Router, tmp_path: Path
):
    source = str(write(tmp_path / "walk.mcap", Leaving.pictures))  # not opened
    settings = CameraSettings(source=source, lockstep="tracker_front")
    connection = at(router.endpoint)
    follower = Node("tracker", connection=connection, publishes=["centroid"])

    def answer() -> None:
        for frame in follower.frames(want="gray"):
            header = follower.header(frame)
            follower.publish(
                "centroid", Centroid(header=header, x=None, y=None, box=None, area=None)
            )

    with follower:
        answering = threading.Thread(target=answer)
        answering.start()

        def leave() -> None:
            follower.stop()
            answering.join(10)
            follower.__exit__(None, None, None)
            wait_until(lambda: not camera.wanted("image/compressed"))

        def opened(*_: object) -> Leaving:
            return Leaving(leave)

        store = ParameterStore(settings)
        with Node(
            "camera", connection=connection, publishes=topics(settings, calibrated=False)
        ) as camera:
            alarm = threading.Timer(20, camera.stop)
            alarm.start()
            try:
                with pytest.raises(ExpectationNotMet, match="ended before it answered frame 1 of"):
                    publish_all(camera, store, settings, opened, None, lambda: camera.stopping)
            finally:
                alarm.cancel()
            counters = camera.counters.snapshot()
    assert (counters["captured"], counters["published"]) == (2, 1)
    assert (counters["dropped.no_subscriber"], counters["pending"]) == (1, 0)


@pytest.mark.parametrize(("lockstep", "offered"), [(None, 1), ("tracker_front", 0)])
def test_frames_that_must_all_arrive_are_not_offered_in_shared_memory(
    client: zenoh.Session, router: Router, lockstep: str | None, offered: int
):
    settings = CameraSettings(lockstep=lockstep)
    publishes = topics(settings, calibrated=False)
    with Node("camera", connection=at(router.endpoint), publishes=publishes):
        wait_for_nodes(client, "camera_front")
        offers = list(client.liveliness().get("@vision/shm/**", timeout=2.0))
    assert len(offers) == offered
