"""A belt through camera and tracker: places, crossings and predictions on the wire."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.listening import Listener, ask
from tests.support.pictures.belt import Belt
from tests.support.processes import ROOT, START_S, Program
from tests.support.waiting import wait_until
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.calibration.ros_yaml import write_calibration
from zenoh_vision.messages import Header, Prediction, Refusal, TrackEvent, Tracks

RATE_HZ = 15
FIELD_MM = Belt.length_mm


@pytest.fixture(scope="module")
def belt() -> Belt:
    return Belt(320, 240, number=1, rate_hz=RATE_HZ, speed_mm_s=160)


@pytest.fixture(scope="module")
def folder(belt: Belt, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures of the belt, and the calibration of its camera as ``front.yaml``."""
    folder = tmp_path_factory.mktemp("belt")
    for index in range(belt.frames):
        cv2.imwrite(str(folder / f"{index:04d}.jpg"), belt.picture(index))
    k = tuple(belt.lens.k.ravel().tolist())
    h = belt.plane * np.sign(belt.plane[2] @ (160, 120, 1))
    calibration = Calibration(CameraModel(320, 240, k), plane=Plane(tuple(h.ravel().tolist())))
    write_calibration(calibration, folder / "front.yaml")
    return folder


@pytest.fixture
def example(router, tmp_path: Path) -> Iterator[Program]:
    """``pick_from_belt.py`` with a gripper at X = 600 mm."""
    path = ROOT / "examples" / "pick_from_belt.py"
    with Program([path, "gate", "600", router.endpoint], tmp_path, "pick") as program:
        yield program


def test_tracks_have_places_events_their_times_and_queries_get_predictions(
    client, lossless_service, example: Program, belt: Belt, folder: Path
):
    wait_until(
        lambda: list(client.get("@/*/router/subscriber/vision/front/events")),
        15,
        lambda: example.complaints,
    )
    tracks = Listener(client, "vision/front/tracks")
    events = Listener(client, "vision/front/events")
    gate = f"gate world 400,0 400,{Belt.width_mm:g}"
    tracker = lossless_service("tracker", "--lines", gate)
    wait_until(lambda: list(client.get("@/*/router/subscriber/vision/front/image/compressed")))
    lossless_service(
        "camera", "--source", folder, "--rate", RATE_HZ, "--calibration", folder / "front.yaml"
    )

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

    def belt_s(stamp_ns: int) -> float:
        """Return the belt's time at a stamp, from the pictures before and after: their pace may
        not be even."""

        def heads() -> list[Header]:
            return [Tracks.from_bytes(message.payload).header for message in tracks.messages]

        # A prediction may be answered before the tracks of its frame have arrived here.
        wait_until(lambda: heads()[-1].stamp_ns >= stamp_ns)
        found = heads()
        stamps = [each.stamp_ns for each in found]
        times = [belt.time_s(each.seq) for each in found]
        assert stamps[0] <= stamp_ns
        return float(np.interp(stamp_ns, stamps, times))

    def pace(stamp_ns: int, for_s: float = 1.0) -> float:
        """Return how fast the belt's time went in the time before a stamp: 1, if the machine
        keeps up."""
        return (belt_s(stamp_ns) - belt_s(stamp_ns - round(for_s * 1e9))) / for_s

    assert prediction.world is not None
    assert prediction.world_velocity is not None
    newest_ns = prediction.header.stamp_ns
    ahead_s = (prediction.stamp_ns - newest_ns) / 1e9 * pace(newest_ns)
    true_mm = belt.positions(belt_s(newest_ns) + ahead_s)[0]
    assert prediction.world == pytest.approx((true_mm.x_mm, true_mm.y_mm), abs=0.03 * FIELD_MM)
    # On a busy machine the pace changes while the tracker still averages over the one before.
    paces = [pace(newest_ns, for_s) for for_s in (0.3, 0.5, 1.0)]
    along, across = prediction.world_velocity
    assert 160 * min(paces) - 10 <= along <= 160 * max(paces) + 10
    assert across == pytest.approx(0, abs=10)

    crossed = wait_until(
        lambda: [e for e in events.messages if e.body["event"] == "line_crossed"], START_S + 10
    )
    event = TrackEvent.from_bytes(crossed[0].payload)
    said_s = belt_s(event.stamp_ns or 0)
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
    # A line is fitted to the last 0.3 to 2.4 s, over which the pace of a busy machine changes.
    paces = [pace(event.header.stamp_ns, for_s) for for_s in (0.3, 0.6, 1.2, 2.4)]
    assert float(after_s) * min(paces) <= 200 / 160 + 0.08
    assert float(after_s) * max(paces) >= 200 / 160 - 0.08
    assert int(at_ns) == pytest.approx(event.stamp_ns + float(after_s) * 1e9, abs=1e6)
    assert float(x) == pytest.approx(600, abs=0.015 * FIELD_MM)  # frames came between both asks
    assert 0 < float(sigma) < 0.05 * FIELD_MM
    assert float(y) == pytest.approx(belt.objects[0].y_mm, abs=0.015 * FIELD_MM)
