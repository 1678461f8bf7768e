"""The tracker's messages."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support import detector_models
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header, Level, TrackEvent, Tracks
from zenoh_vision.node.node import Node
from zv.camera.synthetic.scene import Scene
from zv.tracker.camera_tracking import CameraTracking, centroid_of, plane_view
from zv.tracker.camera_tracking import largest_parameters as parameters_of
from zv.tracker.pipelines.largest import LargestObject, MovingObject
from zv.tracker.service import loaded_model
from zv.tracker.settings import TrackerSettings

FRAME = Frame(
    Header(
        camera="rear",
        epoch=5,
        seq=41,
        stamp_ns=7,
        width=160,
        height=120,
        encoding="bgr8",
        node="camera_rear",
        received_ns=9,
    ),
    np.zeros((120, 160, 3), np.uint8),
)


@pytest.fixture
def node() -> Node:
    live = ParameterStore(TrackerSettings())
    for history in (5, 6, 7):
        live.change({"history": history})
    FRAME.revision = live.activate()
    return Node("tracker", camera="rear", parameters=live)


def test_a_centroid_contains_the_detected_object(node: Node):
    centroid = centroid_of(node, FRAME, MovingObject((60, 40, 31, 30), 841.5))
    # 60 + int(31 / 2) = 75, 40 + int(30 / 2) = 55
    assert (centroid.x, centroid.y) == (75, 55)
    assert (centroid.box, centroid.area) == ((60, 40, 31, 30), 841.5)


def test_a_centroid_without_an_object_has_nil_fields(node: Node):
    centroid = centroid_of(node, FRAME, None)
    assert (centroid.x, centroid.y, centroid.box, centroid.area) == (None,) * 4


@pytest.mark.parametrize("found", [None, MovingObject((0, 0, 1, 1), 0.0)], ids=["none", "one"])
def test_a_centroid_has_the_identity_of_its_frame_and_the_name_of_its_node(
    node: Node, found: MovingObject | None
):
    header = centroid_of(node, FRAME, found).header
    source = FRAME.header
    assert (header.camera, header.epoch, header.seq, header.stamp_ns) == ("rear", 5, 41, 7)
    assert (header.width, header.height, header.received_ns) == (160, 120, 9)
    assert (header.node, header.revision) == ("tracker_rear", 3)
    assert header.encoding is None
    assert header.done_ns is not None
    assert source.done_ns is None


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("history", 30),
        ("var_threshold", 4.0),
        ("detect_shadows", False),
        ("closing", 3),
        ("median", 9),
        ("threshold", 126),
    ],
)
def test_every_setting_reaches_the_tracker(name: str, value: object):
    tutorial = parameters_of(TrackerSettings())
    by_setting = LargestObject(parameters_of(TrackerSettings.model_validate({name: value})))
    by_hand = LargestObject(replace(tutorial, **{name: value}))
    default = LargestObject(tutorial)
    noise = np.random.default_rng(5)
    differs = False
    for k in range(60):
        frame = noise.normal(90, 4, (90, 120, 3)).clip(0, 255).astype(np.uint8)
        if k > 10:
            frame[10:24, k : k + 14] = 200
            frame[50:75, 110 - k : 130 - k] = (60, 60, 62)
        found, mask = by_setting.update(frame)
        expected, expected_mask = by_hand.update(frame)
        assert found == expected
        assert np.array_equal(mask, expected_mask)
        differs |= not np.array_equal(mask, default.update(frame)[1])
    assert differs


def test_a_model_that_is_not_used_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    path = str(detector_models.save(tmp_path / "tiny.onnx", "yolov8"))
    loaded_model(TrackerSettings(model=path, pipeline="detector"))
    assert not caplog.text
    loaded_model(TrackerSettings(model=path))
    assert "the model is loaded but not used: pipeline = robust" in caplog.text


class Recorder:
    """A node that keeps what is published."""

    def __init__(self) -> None:
        self.published: list[tuple[str, object]] = []
        self.reports: list[tuple[str, Level, str]] = []
        self.notes: list[str] = []
        self.health = self
        self.counters = self

    def __getattr__(self, name: str) -> object:
        return lambda *_, **__: None

    def header(self, frame: Frame) -> Header:
        return frame.header

    def publish(self, key: object, message: object) -> None:
        self.published.append((str(key), message))

    def report(self, condition: str, level: Level, words: str) -> None:
        self.reports.append((condition, level, words))

    def note(self, name: str) -> None:
        self.notes.append(name)


def test_tracks_and_stays_end_when_a_camera_has_been_silent(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("zv.tracker.camera_tracking.CalibrationSource", Uncalibrated)
    settings = TrackerSettings(zones="all 0,0 320,0 320,240 0,240", keep_lost=2.0)
    recorder = Recorder()
    tracking = CameraTracking(recorder, "rear", settings)  # type: ignore[arg-type]
    room = np.full((240, 320, 3), 90, np.uint8)
    for k in range(40):
        picture = room.copy()
        picture[80:140, max(0, 6 * k - 60) : max(0, 6 * k - 30)] = (40, 60, 200)
        show(tracking, settings, picture, k, k / 10)
    last = recorder.published[-1][1]
    assert isinstance(last, Tracks)
    assert last.zones is not None
    assert (len(last.tracks), last.zones["all"].inside) == (1, 1)
    now_s = time.monotonic()  # keep_lost + EXPIRES_S is 5 s; the stamps are of another clock
    assert not tracking.expire(now_s + 4)
    assert tracking.expire(now_s + 5)
    assert not tracking.expire(now_s + 6)  # once
    last = recorder.published[-1][1]
    assert isinstance(last, Tracks)
    assert last.zones is not None
    assert (last.tracks, last.header.seq) == ((), 39)
    assert (last.zones["all"].inside, last.zones["all"].left) == (0, 1)
    events = [each.event for _, each in recorder.published if isinstance(each, TrackEvent)]
    assert events.count("zone_entered") == events.count("zone_left") == 1
    assert events.count("started") == events.count("ended") == 1


def test_tracks_of_a_paused_replay_do_not_end(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("zv.tracker.camera_tracking.CalibrationSource", Uncalibrated)
    settings, recorder = TrackerSettings(), Recorder()
    for replay in (None, 7):
        tracking = CameraTracking(recorder, "rear", settings)  # type: ignore[arg-type]
        for k in range(40):
            picture = np.full((240, 320, 3), 90, np.uint8)
            picture[80:140, max(0, 6 * k - 60) : max(0, 6 * k - 30)] = (40, 60, 200)
            show(tracking, settings, picture, k, k / 10, replay=replay)
        last = recorder.published[-1][1]
        assert isinstance(last, Tracks)
        assert last.tracks
        assert tracking.expire(time.monotonic() + 3600) == (replay is None)


class Uncalibrated:
    def __init__(self, *_: object) -> None:
        pass

    def newest(self, _: Header) -> Calibration | None:
        return None


class Calibrated(Uncalibrated):
    """A plane of 0.01 units a pixel."""

    def newest(self, _: Header) -> Calibration | None:
        lens = CameraModel(320, 240, (300.0, 0, 160, 0, 300, 120, 0, 0, 1))
        return Calibration(lens, plane=Plane((0.01, 0, 0, 0, 0.01, 0, 0, 0, 1)))


def test_a_plane_is_scaled_to_another_size_but_not_to_another_aspect_ratio():
    lens = CameraModel(640, 480, (500.0, 0, 320, 0, 500, 240, 0, 0, 1))
    calibration = Calibration(lens, plane=Plane((0.01, 0, 0, 0, 0.01, 0, 0, 0, 1)))
    view = plane_view(calibration, 640, 480)
    assert view is not None
    assert view is plane_view(replace(calibration), 640, 480)
    assert view.position(100, 50) == pytest.approx((1, 0.5))
    smaller = plane_view(calibration, 320, 240)
    assert smaller is not None
    # the centre of pixel 100 is 100.5 from the edge: 201 of the larger, whose pixel is 200.5
    assert smaller.position(100, 50) == pytest.approx((2.005, 1.005))
    assert plane_view(calibration, 640, 360) is None
    assert plane_view(replace(calibration, plane=None), 640, 480) is None


def show(
    tracking: CameraTracking,
    settings: TrackerSettings,
    picture: np.ndarray,
    seq: int,
    at_s: float,
    replay: int | None = None,
) -> None:
    """Process the next frame of a camera."""
    header = Header(
        camera="rear",
        epoch=5,
        seq=seq,
        stamp_ns=round(at_s * 1e9),
        width=320,
        height=240,
        encoding="bgr8",
        replay=replay,
    )
    frame = Frame(header, picture)
    frame.revision = ParameterStore(settings).activate()
    tracking.process(frame, picture)


@pytest.mark.parametrize(
    ("interval_s", "black", "changes", "said"),
    [
        (1.0, False, {}, "rear: 1.0 frames/s: objects that move farther than their own size"),
        (0.1, True, {}, "rear: the picture shows nothing: it is black, or the lens is covered"),
        (
            0.1,
            False,
            {"regions": "far 400,0 500,0 500,90"},
            "rear: nothing is detected: `regions` and `ignore` leave no part of the picture",
        ),
    ],
    ids=["a rate that is too low", "a black picture", "a region outside of it"],
)
def test_what_makes_tracking_impossible_is_said_in_the_health_and_taken_back(
    monkeypatch: pytest.MonkeyPatch,
    interval_s: float,
    black: bool,
    changes: dict[str, str],
    said: str,
):
    monkeypatch.setattr("zv.tracker.camera_tracking.CalibrationSource", Uncalibrated)
    settings, recorder = TrackerSettings(), Recorder()
    changed = settings.model_copy(update=changes)
    tracking = CameraTracking(recorder, "rear", settings)  # type: ignore[arg-type]
    room, at_s, reported = Scene(320, 240, 10.0, 1).frame(0)[0], 0.0, []
    for seq in range(60):
        trouble = 20 <= seq < 40
        at_s += interval_s if trouble else 0.1
        picture = np.zeros_like(room) if trouble and black else room
        show(tracking, changed if trouble else settings, picture, seq, at_s)
        reported.append(len(recorder.reports))
    (warned, level, words), (taken_back, usual, nothing) = recorder.reports
    assert (warned, level, words[: len(said)]) == ("scene of rear", Level.WARN, said)
    assert (taken_back, usual, nothing) == ("scene of rear", Level.OK, "")
    assert 20 <= reported.index(1) < 25
    assert 40 <= reported.index(2) < 45
    assert recorder.notes == ["scene_changes"] * black


def test_a_view_that_comes_and_goes_while_nothing_is_learned_is_one_change(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("zv.tracker.camera_tracking.CalibrationSource", Uncalibrated)
    settings, recorder = TrackerSettings(), Recorder()
    tracking = CameraTracking(recorder, "rear", settings)  # type: ignore[arg-type]
    rng = np.random.default_rng(5)
    room, other = (np.kron(rng.integers(40, 200, (24, 32, 3)), np.ones((10, 10, 1))) for _ in "ab")
    for seq in range(100):
        frozen = settings.model_copy(update={"freeze": seq >= 20})
        away = 20 <= seq < 60 and seq % 8 < 6
        show(tracking, frozen, (other if away else room).astype(np.uint8), seq, seq / 10)
    assert recorder.notes == ["scene_changes"]
    assert [level for _, level, _ in recorder.reports] == [Level.WARN, Level.OK]


def test_a_camera_that_shakes_moves_nothing_over_lines_out_of_zones_or_in_the_world(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("zv.tracker.camera_tracking.CalibrationSource", Calibrated)
    settings = TrackerSettings(
        regions="half 0,0 168,0 168,240 0,240",
        zones="left 0,0 162,0 162,240 0,240",
        lines="gate 162,0 162,240",
    )
    recorder, rng = Recorder(), np.random.default_rng(5)
    tracking = CameraTracking(recorder, "rear", settings)  # type: ignore[arg-type]
    wide = np.kron(rng.integers(40, 200, (26, 34, 3)), np.ones((10, 10, 1))).astype(np.uint8)
    for seq in range(120):  # it stands from 4.3 s on; the middle of what is in the region is at 159
        there, right = wide.copy(), 10 + min(180, max(0, 8 * (seq - 20)))
        there[90:150, max(10, right - 30) : right] = (20, 20, 230)
        x, y = rng.integers(-8, 9, 2).tolist() if seq >= 60 else (0, 0)
        show(tracking, settings, there[10 - y : 250 - y, 10 - x : 330 - x].copy(), seq, seq / 10)
        if seq >= 60:
            found = recorder.published[-1][1]
            assert isinstance(found, Tracks)
            (track,) = (each for each in found.tracks if each.state == "confirmed")
            assert track.world == pytest.approx((1.59, 1.1), abs=0.03)
            assert (track.x - x, track.y - y) == pytest.approx((159, 110), abs=3)
    events = [each.event for _, each in recorder.published if isinstance(each, TrackEvent)]
    assert events == ["started", "zone_entered", "confirmed"]
