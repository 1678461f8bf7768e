"""A belt through the tracker: places, crossings and predictions on the wire."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import zenoh

from tests.support.fork_server import SCRIPT
from tests.support.listening import Listener, ask
from tests.support.pictures.belt import Belt
from tests.support.processes import ROOT, START_S, Program
from tests.support.publishing import IMAGE_KEY, PlainCamera, wait_for_subscriber
from tests.support.waiting import wait_until
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.messages import Header, Prediction, Refusal, TrackEvent, Tracks

INFO_KEY = "vision/front/camera_info"
RATE_HZ = 15
FIELD_MM = Belt.length_mm


@pytest.fixture(scope="module")
def belt() -> Belt:
    return Belt(320, 240, number=1, rate_hz=RATE_HZ, speed_mm_s=160)


@pytest.fixture(scope="module")
def pictures(belt: Belt) -> tuple[bytes, ...]:
    found = (cv2.imencode(".jpg", belt.picture(index))[1] for index in range(belt.frames))
    return tuple(jpeg.tobytes() for jpeg in found)


class BeltCamera(PlainCamera):
    """A calibrated camera over a belt, whose stamps are even however busy the machine is.

    It sends nothing until ``begin``.
    """

    def __init__(self, session: zenoh.Session, belt: Belt, pictures: tuple[bytes, ...]) -> None:
        super().__init__(session, pictures=pictures)
        self._belt = belt
        self._ends = len(pictures)
        self._start_ns = 0
        h = belt.plane * np.sign(belt.plane[2] @ (160, 120, 1))
        calibration = Calibration(belt.lens, plane=Plane(tuple(h.ravel().tolist())))
        info = calibration.message(Header(**self.header())).to_bytes()
        session.declare_queryable(INFO_KEY, lambda query: query.reply(INFO_KEY, info))

    def begin(self) -> None:
        """Let the belt run from its beginning."""
        self._start_ns = time.time_ns()

    def belt_s(self, stamp_ns: int) -> float:
        return self._belt.time_s(0) + (stamp_ns - self._start_ns) / 1e9

    def send_next(self) -> None:
        """Send the next picture, if it runs and there is one."""
        if self._start_ns and self.seq < self._ends:
            self.send(stamp_ns=self._start_ns + round(self.seq / RATE_HZ * 1e9))


@pytest.fixture
def camera(client: zenoh.Session, belt: Belt, pictures: tuple[bytes, ...]) -> Iterator[BeltCamera]:
    camera = BeltCamera(client, belt, pictures)
    with camera.at(RATE_HZ, camera.send_next):
        yield camera


@pytest.fixture
def example(router, tmp_path: Path) -> Iterator[Program]:
    """``pick_from_belt.py`` with a gripper at X = 600 mm."""
    path = ROOT / "examples" / "pick_from_belt.py"
    with Program([path, "gate", "600", router.endpoint], tmp_path, "pick", SCRIPT) as program:
        yield program


def test_tracks_have_world_positions_events_have_times_and_queries_return_predictions(
    client, lossless_service, example: Program, belt: Belt, camera: BeltCamera
):
    wait_until(
        lambda: list(client.get("@/*/router/subscriber/vision/front/events")),
        15,
        lambda: example.complaints,
    )
    tracks = Listener(client, "vision/front/tracks")
    events = Listener(client, "vision/front/events")
    gate = f"gate world 400,0 400,{Belt.width_mm:g}"
    tracker = lossless_service("tracker", "--lines", gate, "--max-age", 30)
    wait_for_subscriber(client, IMAGE_KEY)
    camera.begin()

    def seen() -> list[Tracks]:
        found = [Tracks.from_bytes(message.payload) for message in tracks.messages]
        return [each for each in found if any(track.age_s > 1 for track in each.tracks)]

    wait_until(seen, START_S + 15, lambda: tracker.complaints)
    asked = seen()[-1]
    (track,) = (each for each in asked.tracks if each.age_s > 1)
    (answer,) = ask(client, f"vision/front/prediction?id={track.id};ahead_ms=500")
    prediction = Prediction.from_bytes(answer.payload)
    assert prediction.id == track.id
    (error,) = client.get("vision/front/prediction?id=999;ahead_ms=500")
    refusal = Refusal.from_bytes(error.err.payload.to_bytes())
    assert (refusal.error, refusal.allowed) == ("no track 999 now", str(track.id))
    assert not any("prediction" in each.key for each in ask(client, "vision/front/**"))

    assert prediction.world is not None
    assert prediction.world_velocity is not None
    true_mm = belt.positions(camera.belt_s(prediction.stamp_ns))[0]
    assert prediction.world == pytest.approx((true_mm.x_mm, true_mm.y_mm), abs=0.01 * FIELD_MM)
    assert prediction.world_velocity == pytest.approx((160, 0), abs=4)

    crossed = wait_until(
        lambda: [e for e in events.messages if e.body["event"] == "line_crossed"], START_S + 10
    )
    event = TrackEvent.from_bytes(crossed[0].payload)
    said_s = camera.belt_s(event.stamp_ns or 0)
    assert said_s == pytest.approx(belt.crossing_s(1, 400), abs=0.06)
    assert event.world == pytest.approx((400, belt.objects[0].y_mm), abs=0.01 * FIELD_MM)
    for each in seen():
        truth = belt.positions(belt.time_s(each.header.seq))[0]
        if not 0 < truth.x_mm < FIELD_MM - 100:
            continue
        places = [t.world for t in each.tracks if t.state == "confirmed" and t.missing_s == 0]
        for place in places:
            assert place == pytest.approx((truth.x_mm, truth.y_mm), abs=0.015 * FIELD_MM)
    assert len(crossed) == 1

    said = r"id (\d+): (\S+) s after the line, at (\d+) ns: X (\S+) \S+ (\S+), Y (\S+) .*"
    id_, after_s, at_ns, x, sigma, y = example.lines(said)[0].groups()
    assert example.interrupt() == 0
    assert not example.complaints
    assert int(id_) == event.id
    assert float(after_s) == pytest.approx(200 / 160, abs=0.08)
    assert int(at_ns) == pytest.approx(event.stamp_ns + float(after_s) * 1e9, abs=1e6)
    assert float(x) == pytest.approx(600, abs=0.015 * FIELD_MM)  # frames came between both asks
    assert 0 < float(sigma) < 0.05 * FIELD_MM
    assert float(y) == pytest.approx(belt.objects[0].y_mm, abs=0.015 * FIELD_MM)
