"""What the camera's loop sets up before it needs a router, and what it publishes of a picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.config.revisions import ParameterStore, Revision
from zenoh_vision.errors import ParameterRefused, PayloadError, RouterUnreachable
from zenoh_vision.health.health import Health
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.messages import CameraInfo, Level, Message, Track, Tracks
from zenoh_vision.node.node import Node
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.publisher import ReplyLimit
from zv.camera import service
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings

NOISE = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
TRACK = Track(id=1, state="confirmed", x=110, y=60, box=(100, 50, 20, 20), area=300)


class Publishing:
    """A node without a network, to whose compressed pictures someone subscribes."""

    camera, name = "front", "camera_front"

    def __init__(self) -> None:
        self.health = Health(self.name, FrameCounters("captured", "published"))
        self.report = self.health.report
        self.messages: list[Message] = []
        self.frames: list[Frame] = []
        self.sent: list[bytes | None] = []
        self.dropped: list[str] = []

    def publish(self, _topic: str, message: Message) -> None:
        self.messages.append(message)

    def publish_picture(
        self, _topic: object, frame: Frame, *, compress: Callable[[Frame], bytes | None]
    ) -> None:
        self.frames.append(frame)
        self.sent.append(compress(frame))

    def limit_replies(self, _topic: object, camera: str, limit: ReplyLimit) -> None:
        assert camera == self.camera
        self.may_reply = limit

    def drop(self, error: PayloadError) -> None:
        self.dropped.append(error.reason)


class Camera:
    """A camera without a network; its calibration is of 640x480, in the flip of the start."""

    def __init__(self, **settings: Any) -> None:
        self.settings = CameraSettings(**settings)
        self.node = Publishing()
        lens = CameraModel(640, 480, (500.0, 0, 300, 0, 480, 250, 0, 0, 1), "plumb_bob", (0.0,) * 5)
        self._maker = service.FrameMaker(self.node, self.settings.geometry, Calibration(lens))
        self._limit = service.stream_limit(self.node, lambda: self.settings.max_kbps)
        self._seq = 0

    def publish(self, pixels: np.ndarray = NOISE) -> None:
        revision = Revision(7, self.settings)
        captured = CapturedFrame(PixelPicture(pixels), (TRACK,), 3, self._seq, 5, revision)
        self._seq += 1
        if (frame := self._maker.frame(captured)) is not None:
            self.node.publish_picture("image/compressed", frame, compress=self._limit.compress)


def test_frame_truth_and_calibration_have_one_header_and_one_geometry():
    camera = Camera(flip="horizontal", region="500,40,100,80", encoding="mono8", quality=33)
    camera.publish()
    info, truth = camera.node.messages
    (frame,) = camera.node.frames
    header = {"camera": "front", "epoch": 3, "seq": 0, "stamp_ns": 5, "width": 100, "height": 80}
    header |= {"node": "camera_front", "revision": 7}
    assert isinstance(info, CameraInfo)
    assert isinstance(truth, Tracks)
    for said, encoding in ((info.header, None), (truth.header, None), (frame.header, "mono8")):
        assert {name: getattr(said, name) for name in header} == header
        assert said.encoding == encoding
    assert truth.tracks[0].box == (20, 10, 20, 20)  # 640 - 100 - 20 - 500
    assert (info.k[2], info.k[5]) == (300 - 500, 250 - 40)
    assert frame.pixels.shape == (80, 100)
    assert (frame.quality, frame.captured, frame.revision.number) == (33, True, 7)


def test_a_limit_of_bandwidth_makes_what_is_sent_smaller_and_nothing_else():
    camera = Camera(max_kbps=10)
    camera.publish()
    (sent,) = camera.node.sent
    (frame,) = camera.node.frames
    assert len(sent) < 12_000
    assert (frame.header.width, frame.header.height) == (640, 480)
    assert np.array_equal(frame.pixels, NOISE)
    assert camera.node.messages[1].tracks == (TRACK,)
    remark = "max_kbps = 10: quality 30 instead of 80, a quarter of each side"
    assert camera.node.health.diagnostics().message == remark
    refused = [camera.node.may_reply(100_000) is not None for _ in range(2)]
    assert refused == [False, True], "the first is paid for later"
    camera.settings = CameraSettings()
    camera.publish()
    assert camera.node.health.diagnostics().message == "ok"


def test_the_warning_of_a_calibration_that_does_not_fit_ends_when_it_fits_again():
    camera = Camera()
    camera.publish(NOISE[:100])
    said = camera.node.health.message("calibration")
    assert said.startswith("no camera_info: picture: 640x100; allowed: 640x480 of the calibration")
    camera.publish(NOISE[:100])
    camera.node.report("source", Level.OK)  # pictures are back
    assert camera.node.health.message("calibration") == said
    camera.publish()
    assert camera.node.health.message("calibration") == ""
    assert len(camera.node.frames) == 3


def test_a_picture_that_cannot_be_published_is_dropped_with_its_truth():
    camera = Camera(source="0", region="600,400,40,80")
    camera.publish(NOISE[:470])
    assert (camera.node.dropped, camera.node.frames, camera.node.messages) == (
        ["region_outside"], [], [],
    )  # fmt: skip


def test_a_camera_is_judged_by_its_configured_rate(monkeypatch: pytest.MonkeyPatch):
    made: list[Node] = []

    class Kept(Node):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, **options)  # type: ignore[arg-type]
            made.append(self)

    monkeypatch.setattr(service, "Node", Kept)
    nowhere = Connection("tcp/127.0.0.1:1", timeout_s=0.1)
    with pytest.raises(RouterUnreachable):
        service.run(CameraSettings(width=64, height=48, rate=12), nowhere)
    bounds = made[0].health.rates
    said = [bounds.judge(float(s), {"captured": 6 * s}) for s in range(20)]
    assert said[-1] == ["6 Hz captured, under the 12 Hz configured"]


@pytest.mark.parametrize(
    ("started_with", "allowed"),
    [
        ({}, {"width": 1920, "height": 1200}),
        ({"width": 3840, "height": 2160}, {"width": 2160, "height": 3840}),
        ({"max_pixels": 640 * 480}, {"width": 480, "height": 640}),
        ({"width": 160, "height": 120, "max_pixels": 3840 * 2160}, {"width": 3840, "height": 2160}),
    ],
)
def test_nobody_sets_a_size_over_the_limit_while_it_runs(started_with, allowed):
    store = ParameterStore(CameraSettings(**started_with).limited())
    store.change(allowed)
    with pytest.raises(ParameterRefused, match="is over max_pixels"):
        store.change({"height": allowed["height"] + 1})
    assert {name: getattr(store.newest.settings, name) for name in allowed} == allowed


def test_the_limit_of_pixels_is_that_of_a_size_that_the_settings_determine():
    CameraSettings(source="a.mp4", max_pixels=100_000)  # of any size
    CameraSettings(source="/dev/video0", max_pixels=100_000, width=640)
    with pytest.raises(ValueError, match="640x480 is over max_pixels"):
        CameraSettings(source="/dev/video0", max_pixels=100_000, width=640, height=480)


@pytest.mark.parametrize(
    ("supervised", "wanted", "waits"),
    [("", None, False), ("1", None, True), ("1", False, False), ("", True, True)],
)
def test_a_camera_waits_for_its_source_where_it_is_supervised_unless_it_is_told(
    supervised: str, wanted: bool | None, waits: bool, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("ZV_SUPERVISED", supervised)
    assert service.waits_for_source(CameraSettings(wait_for_source=wanted)) == waits
